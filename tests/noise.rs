//! Tests of pictures of paths that are drawn until their noise is low.

mod support;

use std::fs;

use kdray::{
    engine::{Engine, LoadRequest, NoiseGoal, NoisePicture},
    frame::{Crop, Denoise, Drawn, Goal, Integrator, Picture, RenderOptions, SampleRange, Watcher},
    gpu::DeviceOverrides,
    world::World,
};
use support::{
    assert_silent,
    command::{cornell, fail, stdout, succeed},
    device, pretended,
};
use tempfile::TempDir;

/// Side of a tile, pixels.
const SIDE: u32 = 16;

/// Options of a picture that cuts tiles at its right and its lower edge.
fn options() -> RenderOptions {
    RenderOptions {
        width: 72,
        height: 56,
        integrator: Integrator::Path,
        denoise: Denoise::Off,
        max_depth: 3,
        pixel_aovs: true,
        ..RenderOptions::default()
    }
}

fn world() -> World {
    Engine::on_cpu().load(cornell().as_str(), &LoadRequest::default()).unwrap().world
}

/// Returns the picture of a fixed number of samples.
fn fixed(engine: &Engine, world: &World, options: &RenderOptions, n_samples: u32) -> (Picture, Drawn) {
    let mut renderer = engine.renderer(world, options).unwrap();
    let drawn = renderer.draw(&world.scene().camera, Goal::Samples(n_samples), || ()).unwrap();
    (renderer.picture().unwrap().into_owned(), drawn)
}

fn until(engine: &Engine, world: &World, options: &RenderOptions, goal: NoiseGoal) -> NoisePicture {
    let mut renderer = engine.renderer(world, options).unwrap();
    renderer.draw_until(&world.scene().camera, goal, || ()).unwrap()
}

/// Returns the samples that each tile has, row by row, which must be the same in all of its pixels.
fn samples_of_tiles(drawn: &Drawn, options: &RenderOptions) -> Vec<u32> {
    let (width, height) = (options.width, options.height);
    let at = |x: u32, y: u32| drawn.pixel_aovs[(y * width + x) as usize].n_samples;
    let tiles = (0..height).step_by(SIDE as usize).flat_map(|y| (0..width).step_by(SIDE as usize).map(move |x| (x, y)));
    let samples = |(x0, y0): (u32, u32)| {
        for y in y0..(y0 + SIDE).min(height) {
            assert!((x0..(x0 + SIDE).min(width)).all(|x| at(x, y) == at(x0, y0)), "the tile at {x0}, {y0}");
        }
        at(x0, y0)
    };
    tiles.map(samples).collect()
}

/// Each tile has the bits of the picture of as many samples as the tile has, on the CPU, on a device and on several.
#[test]
fn tiles_have_the_bits_of_pictures_of_fixed_numbers_of_samples() {
    let options = options();
    let world = world();
    let goal = NoiseGoal { noise: 0.03, most_samples: 256 };
    let devices = [device(), device()];
    let engines = [Engine::on_cpu(), Engine::on_device(devices[0].clone()), Engine::on_devices(devices.to_vec())];
    let found = engines.each_ref().map(|engine| {
        let NoisePicture { picture, drawn, mean_samples, n_tiles, n_noisy } = until(engine, &world, &options, goal);
        let of_tiles = samples_of_tiles(&drawn, &options);
        assert_eq!((picture.width, picture.height, of_tiles.len(), n_tiles), (72, 56, 20, 20));
        let mut counts = of_tiles.clone();
        counts.sort_unstable();
        counts.dedup();
        assert!(counts.len() >= 3, "tiles differ in what they need: {of_tiles:?}");
        assert_eq!(drawn.n_samples, counts[counts.len() - 1]);
        assert!(n_noisy <= of_tiles.iter().filter(|&&n| n == goal.most_samples).count());
        let all = drawn.pixel_aovs.iter().map(|aovs| f64::from(aovs.n_samples)).sum::<f64>();
        assert!((mean_samples - all / (72.0 * 56.0)).abs() < 1e-9);
        for n_samples in counts {
            let (whole, of_whole) = fixed(engine, &world, &options, n_samples);
            for (ix, aovs) in drawn.pixel_aovs.iter().enumerate().filter(|(_, it)| it.n_samples == n_samples) {
                assert_eq!(picture.radiance[ix], whole.radiance[ix], "pixel {ix} of {n_samples} samples");
                assert_eq!(aovs, &of_whole.pixel_aovs[ix]);
            }
        }
        picture
    });
    assert!(found[1] == found[2], "several devices draw the same picture");
    devices.iter().for_each(|context| assert_silent(context));
}

/// The watcher is told of the picture as of one sample, whose share grows from band to band.
#[test]
fn the_progress_of_a_picture_in_bands_adds_up_to_one_sample() {
    /// What a watcher is told: `None` is a sample of a band.
    #[derive(Default)]
    struct Told(Vec<Option<f32>>);
    impl Watcher for &mut Told {
        fn sample_progress(&mut self, share: f32) {
            self.0.push(Some(share));
        }

        fn sample(&mut self) {
            self.0.push(None);
        }
    }
    let options = RenderOptions { width: 64, height: 96, max_depth: 2, ..options() };
    let world = world();
    let device = pretended(DeviceOverrides { storage_range: Some(64 * 128 * 50), ..DeviceOverrides::default() });
    let mut renderer = Engine::on_device(device).renderer(&world, &options).unwrap();
    let (mut told, goal) = (Told::default(), NoiseGoal { noise: 1e-9, most_samples: 128 });
    renderer.draw_until(&world.scene().camera, goal, &mut told).unwrap();
    let n_bands = renderer.n_bands();
    assert!(n_bands > 1, "{n_bands}");
    let (mut n_done, mut shares) = (0, Vec::new());
    for part in told.0 {
        match part {
            Some(share) => shares.push((n_done as f32 + share) / n_bands as f32),
            None => n_done += 1,
        }
    }
    assert_eq!(n_done, n_bands);
    // The number of samples doubles, and no tile ever has little noise.
    let expected = [0.125, 0.25, 0.5, 1.0];
    assert!(shares.iter().zip(expected).all(|(share, of)| (share - of).abs() < 1e-3), "{shares:?}");
    assert_eq!(shares.len(), expected.len());
}

/// If no tile ever has little noise, the picture is that of the most samples, with all of its layers.
#[test]
fn without_an_end_the_picture_has_the_most_samples() {
    let options = RenderOptions { light_layers: true, surface_layers: true, width: 20, height: 12, ..options() };
    let world = world();
    for engine in [Engine::on_cpu(), Engine::on_device(device())] {
        let drawn = until(&engine, &world, &options, NoiseGoal { noise: 1e-9, most_samples: 64 });
        let (picture, of_picture) = fixed(&engine, &world, &options, 64);
        assert_eq!((drawn.n_noisy, drawn.n_tiles, drawn.mean_samples), (2, 2, 64.0));
        assert!(drawn.picture.radiance == picture.radiance);
        assert!(drawn.drawn.pixel_aovs == of_picture.pixel_aovs);
        assert!(drawn.drawn.layers == of_picture.layers && !of_picture.layers.is_empty());
    }
}

#[test]
fn crops_have_the_bits_of_the_whole_picture() {
    let options = options();
    let world = world();
    let engine = Engine::on_device(device());
    let goal = NoiseGoal { noise: 0.03, most_samples: 128 };
    let whole = until(&engine, &world, &options, goal).picture;
    let crop: Crop = "13,7,50,41".parse().unwrap();
    let part = until(&engine, &world, &RenderOptions { crop: Some(crop), ..options }, goal).picture;
    assert_eq!((part.width, part.height), (37, 34));
    for (y, row) in (crop.y0..crop.y1).zip(part.radiance.chunks_exact(37)) {
        let begin = (y * whole.width + crop.x0) as usize;
        assert!(row == &whole.radiance[begin..begin + 37], "row {y}");
    }
}

/// After a picture of tiles, a renderer draws other pictures as before.
#[test]
fn other_pictures_follow() {
    let options = options();
    let world = world();
    let camera = world.scene().camera;
    let devices = [device(), device()];
    for engine in [Engine::on_cpu(), Engine::on_device(device()), Engine::on_devices(devices.to_vec())] {
        let (alone, _) = fixed(&engine, &world, &options, 4);
        let mut renderer = engine.renderer(&world, &options).unwrap();
        let goal = NoiseGoal { noise: 0.05, most_samples: 64 };
        let first = renderer.draw_until(&camera, goal, || ()).unwrap().picture;
        renderer.draw(&camera, Goal::Samples(4), || ()).unwrap();
        assert!(renderer.picture().unwrap().radiance == alone.radiance);
        assert!(renderer.draw_until(&camera, goal, || ()).unwrap().picture == first);
    }
}

/// The error of the picture against one of many samples is about what the goal says, and halves with it.
#[test]
fn the_error_is_what_the_goal_says() {
    let options = RenderOptions { width: 48, height: 32, ..options() };
    let world = world();
    let engine = Engine::on_device(device());
    let (reference, _) = fixed(&engine, &world, &options, 2048);
    let shown = |value: f32| match f64::from(value) {
        value if value < 1.0 => value.max(0.0).sqrt(),
        value => 1.0 + 0.5 * value.ln(),
    };
    let error_of = |picture: &Picture| {
        let pairs = picture.radiance.iter().zip(&reference.radiance);
        let squares = pairs.map(|(a, b)| (0..3).map(|i| (shown(a[i]) - shown(b[i])).powi(2)).sum::<f64>() / 3.0);
        (squares.sum::<f64>() / picture.radiance.len() as f64).sqrt()
    };
    for noise in [0.04, 0.02] {
        let NoisePicture { picture, mean_samples, n_noisy, .. } =
            until(&engine, &world, &options, NoiseGoal { noise, most_samples: 512 });
        let error = error_of(&picture);
        let share = error / f64::from(noise);
        println!("noise {noise}: error {error:.4}, {mean_samples:.1} samples, {n_noisy} noisy");
        assert_eq!(n_noisy, 0);
        // Tiles end at powers of two, so most have less noise than the goal allows.
        assert!((0.3..1.05).contains(&share), "noise {noise}: error {error}");
    }
    let few = fixed(&engine, &world, &options, 16).0;
    assert!(error_of(&few) > 0.04, "a picture of few samples has more noise: {}", error_of(&few));
}

#[test]
fn the_command_draws_until_the_noise_is_low() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let scene = cornell();
    let common = ["render", &scene, "--size", "48x40", "--integrator", "path", "--max-depth", "3", "--cpu"];
    let render = |more: &[&str]| succeed(path, &[&common, more].concat());
    let report =
        stdout(&render(&["--noise", "0.05", "--aov", "samples,variance", "-o", "a.exr", "--profile", "a.json"]));
    assert!(report.contains("noise 0.05: ") && report.contains(" samples a pixel on average"), "{report}");
    let json: serde_json::Value = serde_json::from_slice(&fs::read(path.join("a.json")).unwrap()).unwrap();
    assert_eq!(json["noise"]["n_tiles"], 9);
    let mean = json["noise"]["mean_samples"].as_f64().unwrap();
    assert!((32.0..=4096.0).contains(&mean), "{mean}");
    // Tiles of rows, which need not be rows of tiles, are joined to the same picture.
    render(&["--noise", "0.05", "--spp", "128", "-o", "whole.exr", "-q"]);
    for tile in ["1/3", "2/3", "3/3"] {
        let output = format!("{}.exr", &tile[..1]);
        render(&["--noise", "0.05", "--spp", "128", "--tile", tile, "-o", &output, "-q"]);
    }
    succeed(path, &["merge", "3.exr", "1.exr", "2.exr", "-o", "joined.exr", "-q"]);
    assert!(fs::read(path.join("joined.exr")).unwrap() == fs::read(path.join("whole.exr")).unwrap());
    render(&["--noise", "0.06", "--spp", "128", "--tile", "2/3", "-o", "2.exr", "-q"]);
    fail(path, &["merge", "3.exr", "1.exr", "2.exr", "-o", "joined.exr"], 3, "noise: 0.05");

    let refused = |more: &[&str], named: &str| fail(path, &[&common, more].concat(), 2, named);
    refused(&["--noise", "0"], "expected a number from 0.0001 to 1");
    refused(&["--noise", "0.1", "--spp", "100"], "--spp 100 is none of them");
    refused(&["--noise", "0.1", "--spp", "16"], "--spp 16 is none of them");
    refused(&["--noise", "0.1", "--denoise", "edge"], "--noise needs --denoise off");
    refused(&["--noise", "0.1", "--time", "1s"], "--time");
    refused(&["--noise", "0.1", "--samples", "0-32"], "--samples");
    fail(path, &["render", &scene, "--noise", "0.1", "--cpu"], 2, "--noise needs --integrator path");
}

/// Ends a picture when it has been asked a number of times.
struct EndsAt {
    n_asked: u32,
    ask: u32,
}

impl EndsAt {
    fn ask(ask: u32) -> Self {
        Self { n_asked: 0, ask }
    }
}

impl Watcher for &mut EndsAt {
    fn sample(&mut self) {}

    fn ends(&mut self) -> bool {
        self.n_asked += 1;
        self.n_asked == self.ask
    }
}

/// A picture that its watcher ends is the picture of the samples so far.
#[test]
fn a_watcher_ends_a_picture_with_the_samples_so_far() {
    let world = world();
    let camera = world.scene().camera;
    let size = |integrator| RenderOptions { integrator, width: 20, height: 12, ..options() };
    for engine in [Engine::on_cpu(), Engine::on_device(device())] {
        let whitted = RenderOptions { pixel_aovs: false, ..size(Integrator::Whitted) };
        for (options, ask) in [(size(Integrator::Path), 2), (whitted, 3)] {
            let mut renderer = engine.renderer(&world, &options).unwrap();
            let drawn = renderer.draw(&camera, Goal::Samples(65536), &mut EndsAt::ask(ask)).unwrap();
            assert!(drawn.n_samples >= ask && drawn.n_samples < 65536, "{}", drawn.n_samples);
            let (picture, of_picture) = fixed(&engine, &world, &options, drawn.n_samples);
            assert!(renderer.picture().unwrap().radiance == picture.radiance);
            assert!(drawn.pixel_aovs == of_picture.pixel_aovs);
        }
        let mut renderer = engine.renderer(&world, &size(Integrator::Path)).unwrap();
        let goal = NoiseGoal { noise: 1e-9, most_samples: 4096 };
        let drawn = renderer.draw_until(&camera, goal, &mut EndsAt::ask(3)).unwrap();
        assert_eq!((drawn.drawn.n_samples, drawn.n_noisy), (64, 2));
        // Parts that are joined later have all of their samples.
        let mut never_asked = EndsAt::ask(1);
        let range = SampleRange { first: 16, end: 48 };
        let (drawn, _) = renderer.draw_range(&camera, range, &mut never_asked).unwrap();
        assert_eq!((drawn.n_samples, never_asked.n_asked), (32, 0));
    }
}
