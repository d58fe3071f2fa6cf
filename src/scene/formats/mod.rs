//! Readers of foreign formats: glTF, OBJ with MTL, PLY, STL, and images. Also the table of a material, which scene
//! files and MTL files fill (`material_spec`), that of a map of scene files (`map_spec`), and a scene's images, each
//! decoded once (`image_cache`).

pub(crate) mod gltf;
pub(crate) mod image;
pub(crate) mod image_cache;
pub(crate) mod map_spec;
pub(crate) mod material_spec;
pub(crate) mod mesh_file;
pub(crate) mod obj;
pub(crate) mod ply;
pub(crate) mod scan_colours;
pub(crate) mod stl;
