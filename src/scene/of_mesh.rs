//! Makes a scene of a mesh, and fills in what it lacks.

use std::path::Path;

use super::{
    guess::standard,
    model::{
        LoadOptions, Material, Mesh, Scene, SceneError, Transform, extent,
        lacks::{Lacks, SAMPLES},
        preset,
    },
};

impl Scene {
    /// Makes a scene of a mesh, which gets a default material for each slot, a camera and lights, as the mesh of a file
    /// does.
    ///
    /// # Errors
    /// The mesh's arrays do not fit together; it has no triangles, is too small to be traced, or reaches too far.
    pub fn of_mesh(mesh: Mesh, options: &LoadOptions) -> Result<Scene, SceneError> {
        let name = if mesh.name.is_empty() { "mesh".to_owned() } else { mesh.name.clone() };
        let path = Path::new(&name);
        mesh.check().map_err(|what| SceneError::file(path, format!("it {what}")))?;
        if mesh.faces.is_empty() {
            return Err(SceneError::file(path, "has no triangles"));
        }
        let lacks = Lacks::all(options.look.up.unwrap_or_default());
        let (mut scene, lacks) = Self::of_bare_mesh(path, Scene::empty(path), (mesh, Vec::new()), lacks)?;
        preset::replace(&mut scene, &options.look.materials).map_err(|what| SceneError::file(path, what))?;
        standard::fill_in(path, &mut scene, lacks, options).map_err(|what| SceneError::file(path, what))?;
        Ok(scene)
    }

    /// Places a mesh with its own materials in an empty scene, which lacks everything else.
    pub(super) fn of_bare_mesh(
        path: &Path,
        mut scene: Scene,
        (mesh, materials): (Mesh, Vec<Material>),
        lacks: Lacks,
    ) -> Result<(Scene, Lacks), SceneError> {
        let slots = scene.push_materials(materials, &mesh);
        scene.push_mesh(mesh, Transform::IDENTITY, slots).map_err(|what| SceneError::file(path, what))?;
        extent::check(path, scene.bounds())?;
        scene.defaults.samples = SAMPLES;
        Ok((scene, lacks))
    }
}
