//! The hash of a scene, by which pictures of other scenes are told apart.

use bytemuck::{NoUninit, cast_slice};

use super::{FlatScene, Instances, Textures};

impl FlatScene {
    /// Returns a hash of all that frames read of the scene, except for its camera, as 32 hexadecimal digits: the first
    /// half of a BLAKE3 hash. Names are not part of it.
    pub fn hash(&self) -> String {
        // A field that is added to the scene must be hashed, or be named here.
        let Self {
            name: _,
            origin: _,
            triangles,
            triangle_materials,
            occurrences: _,
            instances,
            materials,
            material_names: _,
            textures,
            lights,
            area_lights,
            environment,
            studio,
            camera: _,
            ambient,
            ground,
            background,
            defaults: _,
        } = self;
        let Textures { texels, textures, material_maps, uvs, corners, n_triangles: _ } = &**textures;
        let mut hasher = blake3::Hasher::new();
        // Each array's length comes first, so that no two scenes have the same sequence of bytes.
        fn add<T: NoUninit>(hasher: &mut blake3::Hasher, array: &[T]) {
            hasher.update(&(array.len() as u64).to_le_bytes());
            hasher.update_rayon(cast_slice(array));
        }
        add(&mut hasher, triangles);
        add(&mut hasher, triangle_materials);
        if let Some(Instances { list, materials, .. }) = instances {
            add(&mut hasher, list);
            add(&mut hasher, materials);
        }
        add(&mut hasher, materials);
        add(&mut hasher, texels);
        add(&mut hasher, textures);
        add(&mut hasher, material_maps);
        add(&mut hasher, uvs);
        add(&mut hasher, corners.as_flattened());
        add(&mut hasher, lights);
        add(&mut hasher, area_lights);
        if let Some(environment) = environment {
            add(&mut hasher, environment.colours());
            add(&mut hasher, &environment.size());
            add(&mut hasher, &[environment.turn()]);
        }
        add(&mut hasher, &[*ambient, *background]);
        if let Some(ground) = ground {
            add(&mut hasher, &[ground.ambient]);
            add(&mut hasher, format!("{:?}", ground.up).as_bytes());
        }
        if let Some(to_viewer) = studio {
            add(&mut hasher, &[*to_viewer]);
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }
}
