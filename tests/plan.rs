//! Tests the plan of a frame: it has every barrier that its passes need, and passes declare what their kernels
//! access.

use std::{collections::BTreeSet, fs};

use kdray::frame::{
    Access, Denoise, FrameProperties, Integrator, Pass, Plan, PlanEntry, Primary, RenderOptions, Resource,
    plan::{self, passes},
};
use kdray::layout::Frame;
use spirq::{
    ReflectConfig,
    ty::{AccessType, DescriptorType},
    var::Variable,
};

/// Returns frames with every combination of passes.
fn frames() -> Vec<FrameProperties> {
    let mut frames = Vec::new();
    for (&primary, n_bounces) in Primary::ALL.iter().zip([3, 2, 1]).chain(Primary::ALL.iter().zip([1, 3, 2])) {
        for flags in 0..192_u32 {
            let [pixel_aovs, is_lit, has_lights, adds_samples, shows_aovs, of_paths] =
                std::array::from_fn(|bit| flags & (1 << bit) != 0);
            let frame = FrameProperties {
                integrator: if of_paths { Integrator::Path } else { Integrator::Whitted },
                primary,
                n_bounces,
                pixel_aovs,
                light_layers: of_paths && has_lights,
                surface_layers: has_lights,
                is_lit,
                has_lights,
                adds_samples,
                denoise: [Denoise::Off, Denoise::Paper { threshold: 1.0 }, Denoise::Edge][flags as usize / 64],
                shows_aovs: shows_aovs && pixel_aovs,
            };
            if of_paths || frame.denoise != Denoise::Edge {
                frames.push(frame);
            }
        }
    }
    frames
}

/// Returns all entries of a frame of two batches, one after the other.
fn entries(plan: &Plan) -> Vec<PlanEntry> {
    let batch = [plan.bounces.concat(), plan.light.clone()].concat();
    [plan.visibility.clone(), batch.clone(), batch, plan.image.clone()].concat()
}

/// Returns the resources that a pass accesses. Two are left out, because visibility and the host order them on their
/// own.
fn accesses(pass: Pass, denoises: bool) -> Vec<(Resource, Access)> {
    // Without a noise filter, these two are one buffer.
    let same = |resource: &Resource| match resource {
        Resource::PixelFiltered if !denoises => Resource::PixelRadiance,
        other => *other,
    };
    let reads = pass.reads().iter().map(|resource| (same(resource), Access::Read));
    let writes = pass.writes().iter().map(|resource| (same(resource), Access::Write));
    let indirect = pass.indirect().map(|resource| (resource, Access::Indirect));
    let ordered =
        |(resource, _): &(Resource, Access)| !matches!(resource, Resource::TriangleIds | Resource::SuspendedRays);
    reads.chain(writes).chain(indirect).filter(ordered).collect()
}

/// Tells whether a barrier orders a later access of a resource after an earlier one.
fn orders(barrier: &PlanEntry, resource: Resource, earlier: Access, later: Access) -> bool {
    let PlanEntry::Barrier { before, after, of } = *barrier else { return false };
    let is_kernel = |access| access != Access::Indirect;
    // A write after a read waits for the kernel or for the indirect read. No memory has to be made visible.
    if earlier != Access::Write {
        return is_kernel(before) == is_kernel(earlier) && is_kernel(after);
    }
    let is_written = matches!(before, Access::Write | Access::Update);
    let is_visible = after == later || (after == Access::Update && is_kernel(later));
    let is_named = later == Access::Write || of.contains(&resource);
    is_written && is_visible && is_named
}

/// Describes the pairs of passes of which the second may run too early.
fn hazards(entries: &[PlanEntry], denoises: bool) -> Vec<String> {
    let mut found = Vec::new();
    for (j, later) in entries.iter().enumerate() {
        let PlanEntry::Run(later) = later else { continue };
        for (i, earlier) in entries[..j].iter().enumerate() {
            let PlanEntry::Run(earlier) = earlier else { continue };
            for (resource, first) in accesses(*earlier, denoises) {
                for (_, then) in accesses(*later, denoises).into_iter().filter(|(other, _)| *other == resource) {
                    let conflict = first == Access::Write || then == Access::Write;
                    if conflict && !entries[i..j].iter().any(|entry| orders(entry, resource, first, then)) {
                        found.push(format!("{earlier:?} {first:?}s {resource:?}, {later:?} {then:?}s it"));
                    }
                }
            }
        }
    }
    found
}

#[test]
fn no_pass_runs_before_what_it_needs_is_there() {
    for frame in frames() {
        let found = hazards(&entries(&Plan::new(&frame)), frame.denoise != Denoise::Off && frame.is_lit);
        assert!(found.is_empty(), "{frame:?}: {found:#?}");
    }
}

/// Without any one of the barriers, some pass could run too early.
#[test]
fn every_barrier_is_needed() {
    let paper = RenderOptions::default().denoise;
    let frames = [(Integrator::Whitted, paper), (Integrator::Path, paper), (Integrator::Path, Denoise::Edge)];
    for (integrator, denoise) in frames {
        let options = RenderOptions {
            integrator,
            denoise,
            pixel_aovs: true,
            light_layers: true,
            surface_layers: true,
            max_depth: 3,
            primary: Primary::SoftwareRaster,
            ..RenderOptions::default()
        };
        let all = entries(&Plan::new(&FrameProperties::new(
            &options,
            &Frame { n_lights: 1, max_depth: 3, ..Frame::default() },
        )));
        let barriers: Vec<_> = (0..all.len()).filter(|&i| matches!(all[i], PlanEntry::Barrier { .. })).collect();
        assert!(barriers.len() > 20);
        for &i in &barriers {
            let mut without = all.clone();
            // This removes the equal barriers of all batches and bounces.
            without.retain(|entry| *entry != all[i]);
            assert!(!hazards(&without, true).is_empty(), "{integrator}, {denoise:?}: {:?} is not needed", all[i]);
        }
    }
}

/// A barrier names only resources that earlier passes have accessed in the way that it states.
#[test]
fn barriers_name_what_they_are_for() {
    for frame in frames() {
        let all = entries(&Plan::new(&frame));
        for (i, entry) in all.iter().enumerate() {
            let PlanEntry::Barrier { before, of, .. } = entry else { continue };
            let earlier: Vec<_> = passes(&all[..i]).flat_map(|pass| accesses(pass, true)).collect();
            for resource in *of {
                assert!(earlier.contains(&(*resource, *before)), "{frame:?}: {resource:?} of {entry:?}");
            }
        }
    }
}

/// Returns the resources that the kernels of a pass read, and those that they write, from their SPIR-V.
fn found_in_kernels(pass: Pass) -> (BTreeSet<Resource>, BTreeSet<Resource>) {
    let files = match pass {
        Pass::Visibility => vec!["visibility.vert.spv".to_owned(), "visibility.frag.spv".to_owned()],
        // Kernels that find hits have modules that differ in their search alone.
        Pass::Trace => vec!["trace_mask.comp.spv".to_owned(), "trace_grid_alpha.comp.spv".to_owned()],
        Pass::PathTrace => vec!["path_trace_mask.comp.spv".to_owned(), "path_trace_grid_alpha.comp.spv".to_owned()],
        Pass::Shadow => vec!["shadow_mask.comp.spv".to_owned(), "shadow_grid_alpha.comp.spv".to_owned()],
        _ => vec![format!("{}.comp.spv", pass.name())],
    };
    let (mut reads, mut writes) = (BTreeSet::new(), BTreeSet::new());
    for file in files {
        let spirv = fs::read(format!("{}/{file}", env!("OUT_DIR"))).expect("SPIR-V");
        let entry_points = ReflectConfig::new().spv(spirv).reflect().expect("valid SPIR-V");
        for variable in entry_points.into_iter().flat_map(|entry_point| entry_point.vars) {
            let Variable::Descriptor { desc_bind, desc_ty, .. } = variable else { continue };
            let resource = Resource::ALL.into_iter().find(|resource| resource.binding() == desc_bind.bind());
            let access = match desc_ty {
                DescriptorType::StorageBuffer(access) | DescriptorType::StorageImage(access) => access,
                _ => AccessType::ReadOnly,
            };
            let Some(resource) = resource else { continue };
            if access != AccessType::WriteOnly {
                reads.insert(resource);
            }
            if access != AccessType::ReadOnly {
                writes.insert(resource);
            }
        }
    }
    (reads, writes)
}

#[test]
fn passes_declare_what_their_kernels_read_and_write() {
    let mut wrong = Vec::new();
    for pass in Pass::all() {
        let (reads, writes) = found_in_kernels(pass);
        // A graphics pass writes its target without a binding.
        let target = (pass == Pass::Visibility).then_some(Resource::TriangleIds);
        let writes: BTreeSet<_> = writes.into_iter().chain(target).collect();
        let declared = (pass.reads().iter().copied().collect(), pass.writes().iter().copied().collect());
        if declared != (reads.clone(), writes.clone()) {
            wrong.push(format!("{pass:?} reads {reads:?}, writes {writes:?}; declared: {declared:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_missing_barrier_is_noticed() {
    let sequence = plan::next_rays();
    assert_eq!(hazards(&sequence, true), Vec::<String>::new());
    let scatter_waits = |entry: &PlanEntry| matches!(entry, PlanEntry::Barrier { after: Access::Read, .. });
    let without: Vec<_> = sequence.into_iter().filter(|entry| !scatter_waits(entry)).collect();
    assert!(hazards(&without, true).iter().any(|hazard| hazard.contains("CompactSpine Writes ScanBlocks")));
}

#[test]
fn the_number_of_passes_is_that_of_the_entries() {
    for frame in frames() {
        let plan = Plan::new(&frame);
        assert_eq!(plan.n_passes(2), passes(&entries(&plan)).count());
    }
}
