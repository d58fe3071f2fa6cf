//! Meshes that are computed: generators and the ground, polygons cut into triangles, normals, tangents, faces that are
//! there twice, and the memory that all this takes.

#[cfg(feature = "files")]
pub(crate) mod coincident;
pub mod generate;
pub(crate) mod ground;
pub(crate) mod needs;
#[cfg(feature = "files")]
pub(crate) mod polygon;
#[cfg(feature = "files")]
pub(crate) mod smooth;
#[cfg(feature = "files")]
pub(crate) mod tangents;
