//! Tests `kdray render --profile` and `--trace`. Each pass of each bounce has its time and its rays, slices are
//! nested, and nothing is measured unless the options request it.

mod support;

use std::{collections::BTreeSet, fs, path::Path, sync::Arc};

use kdray::{
    cpu::{self, Batching},
    frame::{BounceStats, Pass, PassTime, Primary, Profile, RenderOptions, Scope, View},
    gpu::Context,
    layout::Counters,
    render::GpuRenderer,
    world::FlatScene,
};
use serde_json::Value;
use support::{
    command::{cornell, fail, succeed},
    device, scenes, world_of,
};
use tempfile::TempDir;

const N_PIXELS: u32 = 40 * 30;

fn options() -> RenderOptions {
    RenderOptions { width: 40, height: 30, max_depth: 4, ..RenderOptions::default() }
}

fn renderer(context: &Arc<Context>, scene: &FlatScene, options: &RenderOptions, capacity: u32) -> GpuRenderer {
    let world = world_of(scene);
    GpuRenderer::with_queue_capacity(context.clone(), &world, options, capacity).expect("a renderer")
}

fn n_rays_in(passes: &[PassTime], name: &str, bounce: Option<u32>) -> u64 {
    let of_name = passes.iter().filter(|pass| (pass.name, pass.bounce) == (name, bounce));
    of_name.map(|pass| pass.n_rays_in.expect("a number of rays")).sum()
}

/// Returns the kinds of primary visibility that the device supports.
fn primaries(context: &Context) -> &'static [Primary] {
    if context.has_int64_atomics() { Primary::ALL } else { &[Primary::Raster, Primary::Trace] }
}

/// Asserts that each pass has a bounce and a batch if its scope has them, and that the time of tracing is that of all
/// passes before `next`, the first pass after the primary hits. Returns the passes' names.
fn checked_names(profile: &Profile, next: &str) -> Vec<&'static str> {
    for pass in &profile.passes {
        let scope = pass.pass().scope();
        let (is_bounces, is_batches) = (scope == Scope::Bounce, scope != Scope::Frame);
        assert_eq!((pass.bounce.is_some(), pass.batch.is_some()), (is_bounces, is_batches), "{}", pass.name);
    }
    let n_primary = profile.passes.iter().position(|pass| pass.name == next).expect("a next pass");
    let ms: f64 = profile.passes[..n_primary].iter().filter_map(|pass| pass.ms).sum();
    let tracing_ms = profile.tracing_ms(0).expect("timestamps");
    assert!((tracing_ms - ms).abs() < 1e-9, "{tracing_ms} for {ms}");
    profile.passes.iter().map(|pass| pass.name).collect()
}

#[test]
fn the_table_has_every_pass_and_tracing_takes_all_that_find_primary_hits() {
    let (scene, context) = (scenes::mixed(), device());
    let world = world_of(&scene);
    let mut names = BTreeSet::new();
    for &primary in primaries(&context) {
        let options = RenderOptions { primary, pixel_aovs: true, surface_layers: true, ..options() };
        let mut renderer = renderer(&context, &scene, &options, 8 * N_PIXELS);
        for view in [View::Picture, View::Depth, View::Rays] {
            renderer.set_view(view, 1.0);
            for _sample in 0..2 {
                names.extend(checked_names(&renderer.draw_sample().expect("a sample"), "pixel_aovs"));
            }
        }
        let mut on_cpu = cpu::CpuRenderer::new(&world, &options, Batching::default());
        (0..2).for_each(|_sample| names.extend(checked_names(&on_cpu.draw_sample(), "pixel_aovs")));
    }
    let software_raster = |name: &str| name.starts_with("rasterize_") && !context.has_int64_atomics();
    let of_paths =
        |name: &str| name.starts_with("path_") || ["auxiliary", "demodulate", "atrous_filter"].contains(&name);
    let known = Pass::all().map(Pass::name).filter(|name| !software_raster(name) && !of_paths(name));
    assert_eq!(names, known.collect::<BTreeSet<_>>());
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

#[test]
fn every_pass_of_every_batch_and_bounce_has_its_rays() {
    let (scene, context) = (scenes::mixed(), device());
    for (primary, capacity) in [(Primary::Raster, 8 * N_PIXELS), (Primary::Trace, N_PIXELS / 3)] {
        let options = RenderOptions { primary, ..options() };
        let profile = renderer(&context, &scene, &options, capacity).draw().expect("a frame");
        assert_eq!(profile.n_batches > 1, capacity < N_PIXELS);
        let passes = &profile.passes;
        for (bounce, stats) in (0..).zip(&profile.bounces) {
            let out = |name| {
                let of_name = passes.iter().filter(|pass| (pass.name, pass.bounce) == (name, Some(bounce)));
                of_name.map(|pass| pass.n_rays_out.expect("a number of rays")).sum::<u64>()
            };
            let finder = if bounce > 0 || primary == Primary::Trace { "trace" } else { "primary_hit" };
            assert_eq!((n_rays_in(passes, finder, Some(bounce)), out(finder)), (stats.n_rays, stats.n_hits));
            if let Some(next) = profile.bounces.get(bounce as usize + 1) {
                assert_eq!(out("compact_scatter"), next.n_rays);
            }
        }
        let sum = |count: fn(&BounceStats) -> u64| profile.bounces.iter().map(count).sum::<u64>();
        for name in ["shadow", "shade", "resolve"] {
            assert_eq!(n_rays_in(passes, name, None), sum(|bounce| bounce.n_rays), "{name}");
        }
        let tested = passes.iter().filter(|pass| pass.name == "shadow").map(|pass| pass.n_rays_out);
        assert_eq!(tested.sum::<Option<u64>>(), Some(sum(|bounce| bounce.n_shadow_rays)));
        assert!(profile.bounces.iter().all(|bounce| bounce.n_shadow_rays > 0));
        assert_eq!(profile.bounces[0].n_rays, u64::from(N_PIXELS));
        let batches: Vec<_> = passes.iter().filter_map(|pass| pass.batch).collect();
        assert!(batches.is_sorted() && batches.last() == Some(&(profile.n_batches - 1)));
        let once = ["visibility", "denoise", "tonemap"];
        assert!(passes.iter().all(|pass| pass.batch.is_none() == once.contains(&pass.name)));
    }
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

#[test]
fn passes_run_one_after_the_other() {
    let (scene, context) = (scenes::mixed(), device());
    let profile = renderer(&context, &scene, &options(), 8 * N_PIXELS).draw().expect("a frame");
    let spans: Vec<_> = profile.passes.iter().map(|p| (p.start_ms.unwrap(), p.ms.unwrap())).collect();
    assert_eq!(spans[0].0, 0.0);
    assert!(spans.iter().all(|(_, ms)| *ms >= 0.0));
    assert!(spans.windows(2).all(|two| two[0].0 + two[0].1 <= two[1].0 + 1e-9), "{spans:?}");
    let (start, ms) = spans.last().unwrap();
    assert!((profile.frame_ms.unwrap() - (start + ms)).abs() < 1e-9);
}

/// There are neither timestamps nor counts, in whole frames and in frames that have to be split. The picture is the
/// same.
#[test]
fn without_a_profile_nothing_is_measured() {
    let (scene, context) = (scenes::mixed(), device());
    for capacity in [8 * N_PIXELS, N_PIXELS / 3] {
        let mut measured = renderer(&context, &scene, &options(), capacity);
        let mut bare = renderer(&context, &scene, &RenderOptions { profile: false, ..options() }, capacity);
        let (picture, profile) = measured.render().expect("a frame");
        let (same_picture, nothing) = bare.render().expect("a frame");
        assert!(picture == same_picture && !profile.passes.is_empty());
        assert_eq!((nothing.passes.len(), nothing.bounces.len(), nothing.frame_ms), (0, 0, None));
        let counters = |renderer: &GpuRenderer| renderer.resources().counters().expect("counters");
        assert!(counters(&measured).iter().any(|counters| counters.n_hits > 0 && counters.n_shadow_rays > 0));
        assert!(counters(&bare).iter().all(|counters| *counters == Counters::default()));
    }
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

/// Renders a small picture of Cornell's box, and returns its profile and its trace.
fn measure(directory: &Path, more: &[&str]) -> (Value, Value) {
    let scene = cornell();
    let render = ["render", &scene, "--size", "64x48", "-q", "-o", "x.png"];
    succeed(directory, &[&render[..], &["--profile", "profile.json", "--trace", "trace.json"], more].concat());
    let json = |name| serde_json::from_slice(&fs::read(directory.join(name)).unwrap()).unwrap();
    (json("profile.json"), json("trace.json"))
}

struct Slice<'a> {
    name: &'a str,
    track: u64,
    /// Nanoseconds.
    begin: i64,
    end: i64,
    args: &'a Value,
}

fn slices(trace: &Value) -> Vec<Slice<'_>> {
    let events = trace["traceEvents"].as_array().expect("events");
    let nanoseconds = |microseconds: &Value| (microseconds.as_f64().expect("a time") * 1e3).round() as i64;
    (events.iter().filter(|event| event["ph"] == "X"))
        .map(|event| Slice {
            name: event["name"].as_str().expect("a name"),
            track: event["tid"].as_u64().expect("a track"),
            begin: nanoseconds(&event["ts"]),
            end: nanoseconds(&event["ts"]) + nanoseconds(&event["dur"]),
            args: &event["args"],
        })
        .collect()
}

/// Says what is wrong with the slices of a track, if anything is. They must be in the order of their beginnings,
/// outer ones first.
fn fault(slices: &[Slice], track: u64) -> Option<String> {
    let mut open: Vec<&Slice> = Vec::new();
    let mut last = 0;
    for slice in slices.iter().filter(|slice| slice.track == track) {
        if slice.begin < last || slice.end < slice.begin {
            return Some(format!("{} lasts from {} to {} after {last}", slice.name, slice.begin, slice.end));
        }
        last = slice.begin;
        while open.last().is_some_and(|outer| outer.end <= slice.begin && outer.end < slice.end) {
            open.pop();
        }
        if let Some(outer) = open.last().filter(|outer| slice.end > outer.end) {
            return Some(format!("{} sticks out of {}", slice.name, outer.name));
        }
        open.push(slice);
    }
    None
}

#[test]
fn the_trace_has_a_slice_for_each_pass_within_its_bounce() {
    let directory = TempDir::new().unwrap();
    for more in [&[][..], &["--cpu"], &["--repeat", "3", "--primary", "trace"]] {
        let (profile, trace) = measure(directory.path(), more);
        let slices = slices(&trace);
        assert_eq!([1, 2].map(|track| fault(&slices, track)), [None, None], "{more:?}");
        assert_eq!(profile["schema"], 3);
        let passes = profile["passes"].as_array().unwrap();
        let is_pass = |slice: &&Slice| slice.track == 2 && passes.iter().any(|pass| pass["name"] == slice.name);
        let of_passes: Vec<_> = slices.iter().filter(is_pass).collect();
        assert_eq!(of_passes.len(), passes.len(), "{more:?}");
        for (slice, pass) in of_passes.iter().zip(passes) {
            assert_eq!(slice.name, pass["name"].as_str().unwrap());
            let ms = (slice.end - slice.begin) as f64 / 1e6;
            assert!((ms - pass["ms"].as_f64().unwrap()).abs() < 2e-6, "{}", slice.name);
            for key in ["n_rays_in", "n_rays_out"] {
                assert_eq!(slice.args[key], pass[key], "{} {key}", slice.name);
            }
            if pass["batch"].is_null() {
                continue;
            }
            let name = pass["bounce"].as_u64().map_or("light".to_owned(), |bounce| format!("bounce {bounce}"));
            let around = |outer: &&Slice| outer.name == name && outer.begin <= slice.begin && slice.end <= outer.end;
            assert!(slices.iter().any(|outer| around(&outer)), "{} is in no {name}", slice.name);
        }
        assert!(passes.iter().any(|pass| pass["n_rays_in"] == 64 * 48));
    }
}

#[test]
fn reported_rates_count_every_pass_that_finds_primary_hits() {
    let directory = TempDir::new().unwrap();
    for primary in primaries(&device()) {
        let (profile, _) = measure(directory.path(), &["--primary", &primary.to_string()]);
        let passes = profile["passes"].as_array().unwrap();
        let n_primary = passes.iter().position(|pass| pass["name"] == "compact_reduce").unwrap();
        let ms: f64 = passes[..n_primary].iter().filter_map(|pass| pass["ms"].as_f64()).sum();
        let number = |key: &str| profile["bounces"][0][key].as_f64().unwrap();
        assert!((number("tracing_ms") - ms).abs() < 1e-9, "{primary}: {} for {ms}", number("tracing_ms"));
        assert!((number("mrays_per_s") * ms * 1e3 / number("n_rays") - 1.0).abs() < 1e-9, "{primary}");
    }
}

#[test]
fn the_trace_has_the_cpus_work_on_a_track_of_its_own() {
    let directory = TempDir::new().unwrap();
    let on_device = ["create device", "upload scene", "make pipelines", "record", "submit and wait", "fetch counts"];
    let on_device = [&on_device[..], &["fetch picture"]].concat();
    for (more, own) in [(&["--repeat", "2"][..], on_device), (&["--cpu", "--repeat", "2"], vec!["render"])] {
        let (_, trace) = measure(directory.path(), more);
        let slices = slices(&trace);
        let on_cpu: Vec<_> = slices.iter().filter(|slice| slice.track == 1).map(|slice| slice.name).collect();
        for name in [&["load scene", "build tree", "encode picture", "write picture"], &own[..]].concat() {
            let is_repeated = ["record", "submit and wait", "fetch counts", "render"].contains(&name);
            let n = on_cpu.iter().filter(|known| **known == name).count();
            assert_eq!(n, if is_repeated { 2 } else { 1 }, "{name} in {on_cpu:?}");
        }
        let tracks: Vec<_> = (trace["traceEvents"].as_array().unwrap().iter())
            .filter(|event| event["ph"] == "M" && event["name"] == "thread_name")
            .map(|event| event["args"]["name"].as_str().unwrap())
            .collect();
        assert!(tracks[0] == "CPU" && tracks[1].starts_with("passes on "), "{tracks:?}");
        let frame = slices.iter().find(|slice| slice.name == "frame").unwrap();
        let drawing = if more.contains(&"--cpu") { "render" } else { "submit and wait" };
        let around = |slice: &Slice| slice.name == drawing && slice.begin <= frame.begin && frame.begin <= slice.end;
        assert!(slices.iter().any(around), "the frame begins in {drawing}");
    }
}

#[test]
fn slices_that_overlap_or_run_backwards_are_noticed() {
    let args = Value::Null;
    let slice = |begin, end| Slice { name: "x", track: 2, begin, end, args: &args };
    assert_eq!(fault(&[slice(0, 9), slice(0, 4), slice(1, 4), slice(4, 4), slice(4, 9), slice(9, 12)], 2), None);
    for wrong in [[slice(0, 9), slice(8, 10)], [slice(0, 9), slice(5, 4)], [slice(5, 9), slice(4, 6)]] {
        assert!(fault(&wrong, 2).is_some());
        assert!(fault(&wrong, 1).is_none());
    }
}

#[test]
fn files_of_one_name_and_files_that_cannot_be_written_are_refused() {
    let directory = TempDir::new().unwrap();
    let cases: [(&[&str], i32, &str); 4] = [
        (&["--profile", "x", "--trace", "x"], 2, "--profile and --trace"),
        (&["-o", "x.png", "--trace", "x.png"], 2, "--output and --trace"),
        (&["-o", "x.png", "--profile", "x.png"], 2, "--output and --profile"),
        (&["--trace", "none/x.json"], 5, "none/x.json"),
    ];
    for (more, code, named) in cases {
        fail(directory.path(), &[&["render", "none.toml", "--cpu"], more].concat(), code, named);
    }
}
