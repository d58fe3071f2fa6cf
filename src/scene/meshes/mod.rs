//! Meshes that are computed: generators and the ground, polygons cut into triangles, normals, tangents, faces that are
//! there twice, and the memory that all this takes.

pub(crate) mod coincident;
pub mod generate;
pub(crate) mod ground;
pub(crate) mod needs;
pub(crate) mod polygon;
pub(crate) mod smooth;
pub(crate) mod tangents;
