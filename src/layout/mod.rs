//! The structs, constants and bindings that the kernels share with the host. build.rs generates them from
//! `glsl/shared/layout.glsl`, `glsl/shared/scene_arrays.glsl` and the shaders' specialization constants.

pub mod normal;
#[cfg(test)]
mod scene_arrays;
#[cfg(test)]
mod specialization;

include!(concat!(env!("OUT_DIR"), "/layout.rs"));

#[cfg(test)]
/// Name, size in bytes, and each member's type and offset in bytes.
type Struct = (&'static str, usize, &'static [(&'static str, usize)]);

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, fs};

    use spirq::{
        ReflectConfig,
        ty::{ScalarType, StructMember, Type},
        var::Variable,
    };

    use super::*;

    /// Returns the name of the struct at a binding, which holds one such struct or an array of them. Returns none for
    /// bindings of words or vectors.
    fn struct_at(binding: u32) -> Option<&'static str> {
        if let Some((_, element)) = SCENE_ARRAYS.iter().find(|(number, _)| *number == binding) {
            return (*element != "uint").then_some(element);
        }
        match binding {
            BIND_FRAME => Some("Frame"),
            BIND_ACCEL => Some("AccelConstants"),
            BIND_MATERIALS => Some("Material"),
            BIND_LIGHTS => Some("Light"),
            BIND_RAYS => Some("PathRay"),
            BIND_BOUNCES => Some("Bounce"),
            BIND_HITS | BIND_CAST_HITS | BIND_LISTED_HITS => Some("Hit"),
            BIND_HIT_CURSORS => Some("HitCursor"),
            BIND_CAST_RAYS => Some("Ray"),
            BIND_CAST_POINTS => Some("QueryPoint"),
            BIND_PIXEL_AOVS => Some("PixelAovs"),
            BIND_PIXEL_AUX => Some("Auxiliary"),
            BIND_PATH_STATES => Some("PathState"),
            BIND_SHADOW_RAYS => Some("ShadowRay"),
            BIND_COUNTERS => Some("Counters"),
            BIND_RASTER_GROUPS => Some("RasterGroups"),
            BIND_GRID_BUILD => Some("GridBuild"),
            BIND_KD_BUILD => Some("KdBuild"),
            BIND_KD_LEVELS => Some("KdLevel"),
            BIND_KD_TRIANGLES => Some("Triangle"),
            BIND_KD_REFERENCES_FROM | BIND_KD_REFERENCES_TO | BIND_KD_ABOVE => Some("KdReference"),
            BIND_KD_CELLS_FROM | BIND_KD_CELLS_TO => Some("KdCell"),
            BIND_KD_BUILT_NODES | BIND_KD_NODES => Some("KdNode"),
            BIND_KD_LEAF_TRIANGLES => Some("LeafTriangle"),
            BIND_KD_LEAF_PLANES => Some("Plane"),
            BIND_GRID_TRIANGLES => Some("Triangle"),
            BIND_GRID_CELLS => Some("GridCell"),
            BIND_GRID_LEAF_TRIANGLES => Some("LeafTriangle"),
            BIND_GRID_LEAF_PLANES => Some("Plane"),
            BIND_KD_SLAB_TREE => Some("KdSlabTree"),
            BIND_KD_SLAB_BUILD => Some("KdSlabBuild"),
            BIND_KD_SLAB_NODES => Some("KdNode"),
            BIND_KD_SLAB_LEAF_TRIANGLES => Some("LeafTriangle"),
            BIND_KD_SLAB_PATCHES => Some("KdSlabPatch"),
            BIND_KD_SLAB_EXTENTS => Some("KdSlabExtent"),
            BIND_KD_SLAB_SLABS => Some("Slab"),
            BIND_DEFORM_VERTICES => Some("RestVertex"),
            BIND_DEFORM_DELTAS => Some("MorphDelta"),
            BIND_DEFORM_INFLUENCES => Some("JointInfluence"),
            BIND_DEFORM_JOINTS => Some("JointRow"),
            BIND_DEFORM_DEFORMED => Some("DeformedVertex"),
            BIND_DEFORM_TRIANGLES => Some("Triangle"),
            _ => None,
        }
    }

    /// Returns the name of the struct of a shader's push constants.
    fn pushed_to(shader: &str) -> &'static str {
        match shader {
            cast if cast.starts_with("cast_") || cast.starts_with("all_hits_") => "CastBatch",
            "closest_point.comp" => "CastBatch",
            relocate if relocate.ends_with("_relocate.comp") => "StructurePlace",
            kdtree if kdtree.starts_with("kdtree_") => "KdStage",
            "driver.rgen" => "DriverCast",
            "atrous_filter.comp" => "AtrousIteration",
            "deform_vertices.comp" | "deform_triangles.comp" => "DeformMesh",
            "false_color.comp" => "FalseColor",
            "present.frag" => "Present",
            "grid_sort_count.comp" | "grid_sort_scatter.comp" => "GridSort",
            "rasterize_triangles.comp" | "rasterize_blocks.comp" => "RasterPush",
            _ => "Batch",
        }
    }

    fn rust_type(ty: &Type) -> &'static str {
        match ty {
            Type::Scalar(ScalarType::Integer { bits: 32, is_signed: false }) => "u32",
            Type::Scalar(ScalarType::Float { bits: 32 }) => "f32",
            Type::Vector(v)
                if v.nscalar == 2 && v.scalar_ty == (ScalarType::Integer { bits: 32, is_signed: false }) =>
            {
                "[u32; 2]"
            }
            Type::Vector(v) if v.nscalar == 3 && v.scalar_ty == (ScalarType::Float { bits: 32 }) => "glam::Vec3",
            Type::Matrix(m) if (m.nvector, m.vector_ty.nscalar, m.stride) == (4, 4, Some(16)) => "glam::Mat4",
            other => panic!("layout.glsl holds no {other:?}"),
        }
    }

    /// Type and offset of each member of a struct.
    type Members = Vec<(&'static str, usize)>;

    /// Returns the members of a block's only member, which is a struct or an array of structs, and the array's stride
    /// in bytes. Returns no members for an array of vectors or words, of which the kernel assembles its structs.
    fn members_of(block: &Type) -> (Option<Members>, Option<usize>) {
        let Type::Struct(block) = block else { panic!("{block:?} is no block") };
        let (element, stride) = match &block.members[0].ty {
            Type::Array(array) => (&*array.element_ty, array.stride),
            single => (single, None),
        };
        let member = |m: &StructMember| (rust_type(&m.ty), m.offset.expect("an offset"));
        match element {
            Type::Struct(element) => (Some(element.members.iter().map(member).collect()), stride),
            Type::Vector(_) | Type::Scalar(_) => (None, stride),
            other => panic!("{other:?} is neither struct, vector nor word"),
        }
    }

    /// Checks that the kernels see a struct as Rust does.
    fn check(name: &str, block: &Type, structs: &[Struct]) -> Result<(), String> {
        let (_, size, members) = structs.iter().find(|(known, ..)| *known == name).expect("a struct of that name");
        let (found, stride) = members_of(block);
        let is_right = match &found {
            Some(found) => found == members && stride.is_none_or(|stride| stride == *size),
            None => stride.is_some_and(|stride| size.is_multiple_of(stride)),
        };
        if !is_right {
            return Err(format!("{name}: {found:?} with stride {stride:?}, not {members:?} of {size} bytes"));
        }
        Ok(())
    }

    /// Returns the struct name and the block of every binding and push constant of all modules, except for the probes'.
    fn blocks() -> Vec<(&'static str, Type)> {
        let is_probe = |name: &str| ["fused_fma.comp", "lanes.comp", "loop_iterations.comp"].contains(&name);
        let modules = CONSTANTS_OF_SHADERS.iter().map(|(name, _)| *name).filter(|name| !is_probe(name));
        let variables = modules.flat_map(|name| {
            let spirv = fs::read(format!("{}/{name}.spv", env!("OUT_DIR"))).expect("SPIR-V");
            let entry_points = ReflectConfig::new().spv(spirv).ref_all_rscs(true).reflect();
            let variables = entry_points.expect("valid SPIR-V").into_iter().flat_map(|entry_point| entry_point.vars);
            variables.map(move |variable| (name, variable))
        });
        variables
            .filter_map(|(shader, variable)| match variable {
                Variable::Descriptor { desc_bind, ty, .. } => Some((struct_at(desc_bind.bind())?, ty)),
                Variable::PushConstant { ty, .. } => Some((pushed_to(shader), ty)),
                _ => None,
            })
            .collect()
    }

    #[test]
    fn kernels_see_the_structs_as_rust_does() {
        let blocks = blocks();
        for (name, block) in &blocks {
            check(name, block, STRUCTS).unwrap();
        }
        // Kernels assemble these from the words of an array, and find large triangles behind another struct.
        let apart = [
            "AreaLight",
            "CornerSurface",
            "Emitter",
            "GeometryConstants",
            "Instance",
            "KdBox",
            "LargeTriangle",
            "LightNode",
            "MaterialMaps",
            "Texture",
            "TopNode",
        ];
        let seen: BTreeSet<_> = blocks.iter().map(|(name, _)| *name).chain(apart).collect();
        assert_eq!(seen, STRUCTS.iter().map(|(name, ..)| *name).collect());
    }

    #[test]
    fn a_moved_member_is_noticed() {
        let blocks = blocks();
        let is_of_hits = |(name, block): &&(&str, Type)| *name == "Hit" && members_of(block).0.is_some();
        let (_, block) = blocks.iter().find(is_of_hits).expect("some kernel binds hits");
        let moved: Struct = ("Hit", 16, &[("f32", 0), ("u32", 4), ("f32", 12), ("f32", 8)]);
        let swapped: Struct = ("Hit", 16, &[("u32", 0), ("f32", 4), ("f32", 8), ("f32", 12)]);
        let longer: Struct = ("Hit", 20, &[("f32", 0), ("u32", 4), ("f32", 8), ("f32", 12)]);
        for planted in [moved, swapped, longer] {
            assert!(check("Hit", block, &[planted]).is_err(), "{planted:?}");
        }
    }
}
