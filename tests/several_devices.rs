//! Tests of pictures that several devices draw together. A software device that is opened twice stands in for two.

mod support;

use std::{
    fs,
    path::Path,
    sync::{
        Arc, Barrier, Mutex,
        atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use glam::Vec3;
use kdray::{
    engine::{Engine, FilmRenderer, LoadRequest, NoiseGoal, Renderer},
    frame::{Denoise, Drawn, Goal, Integrator, Picture, RenderOptions, Watcher},
    gpu::{Context, DeviceOverrides, GpuError},
    scene::Camera,
    world::World,
};
use support::{
    assert_silent,
    command::{cornell, fail, names, stderr, stdout, succeed},
    device, pretended,
};
use tempfile::TempDir;

fn world() -> World {
    Engine::on_cpu().load(cornell().as_str(), &LoadRequest::default()).unwrap().world
}

/// Draws two pictures one after the other, the second by speeds that the first has shown.
fn draw(contexts: Vec<Arc<Context>>, world: &World, options: &RenderOptions, n_samples: u32) -> [(Picture, Drawn); 2] {
    let mut renderer = Engine::on_devices(contexts).renderer(world, options).unwrap();
    [(), ()].map(|()| draw_next(&mut renderer, world, n_samples))
}

/// Draws a picture. The watcher has to be told of each sample of the whole picture once.
fn draw_next(renderer: &mut Renderer, world: &World, n_samples: u32) -> (Picture, Drawn) {
    let mut samples = Samples::default();
    let drawn = renderer.draw(&world.scene().camera, Goal::Samples(n_samples), &mut samples).unwrap();
    assert_eq!(samples.n_samples, n_samples, "samples that the watcher is told of");
    assert!((0.0..=1.0).contains(&samples.last_part), "{}", samples.last_part);
    (renderer.picture().unwrap().into_owned(), drawn)
}

#[derive(Default)]
struct Samples {
    n_samples: u32,
    last_part: f32,
}

impl Watcher for &mut Samples {
    fn sample_progress(&mut self, share: f32) {
        self.last_part = share;
    }

    fn sample(&mut self) {
        self.n_samples += 1;
    }
}

/// Pictures of all kinds have the bits of one device's: those whose samples are shared, and those whose columns are.
#[test]
fn pictures_have_the_bits_of_one_device() {
    let of_paths = RenderOptions { integrator: Integrator::Path, max_depth: 3, ..RenderOptions::default() };
    let paper = Denoise::Paper { threshold: 0.5 };
    for (options, n_samples) in [
        (RenderOptions { denoise: Denoise::Off, ..of_paths.clone() }, 72),
        (RenderOptions { denoise: Denoise::Off, ..of_paths.clone() }, 8),
        (RenderOptions { denoise: paper, crop: Some("3,5,40,33".parse().unwrap()), ..of_paths.clone() }, 48),
        (RenderOptions { denoise: Denoise::Edge, ..of_paths.clone() }, 32),
        (
            RenderOptions {
                denoise: Denoise::Off,
                pixel_aovs: true,
                light_layers: true,
                surface_layers: true,
                ..of_paths
            },
            32,
        ),
        (RenderOptions { denoise: paper, pixel_aovs: true, ..RenderOptions::default() }, 3),
        (RenderOptions { crop: Some("0,1,48,2".parse().unwrap()), ..RenderOptions::default() }, 1),
    ] {
        let options = RenderOptions { width: 48, height: 36, profile: true, ..options };
        let world = world();
        let contexts = [device(), device(), device()];
        let [one, _] = draw(contexts[..1].to_vec(), &world, &options, n_samples);
        for several in [&contexts[..2], &contexts] {
            for (picture, drawn) in draw(several.to_vec(), &world, &options, n_samples) {
                assert!(picture == one.0, "{options:?}");
                assert!(drawn.pixel_aovs == one.1.pixel_aovs && drawn.layers == one.1.layers, "{options:?}");
                assert_eq!(drawn.n_samples, n_samples);
                let rays = |drawn: &Drawn| drawn.profile.bounces[0].n_rays;
                match options.denoise {
                    Denoise::Off => assert_eq!(rays(&drawn), rays(&one.1), "{options:?}"),
                    // Each tile also draws the border that its filter reads.
                    _ => assert!(rays(&drawn) >= rays(&one.1), "{options:?}"),
                }
                assert!(drawn.profile.device.starts_with(&format!("{} x ", several.len())));
            }
        }
        contexts.iter().for_each(|context| assert_silent(context));
    }
}

/// The comparison can fail: other samples make another picture.
#[test]
fn other_samples_make_another_picture() {
    let options = RenderOptions { integrator: Integrator::Path, denoise: Denoise::Off, ..RenderOptions::default() };
    let options = RenderOptions { width: 24, height: 18, max_depth: 2, ..options };
    let world = world();
    let mut renderer = Engine::on_devices(vec![device(), device()]).renderer(&world, &options).unwrap();
    let camera = world.scene().camera;
    let range = |word: &str| word.parse().unwrap();
    let (_, first) = renderer.draw_range(&camera, range("0-64"), || ()).unwrap();
    let (_, later) = renderer.draw_range(&camera, range("64-128"), || ()).unwrap();
    assert!(first.picture.mean() != later.picture.mean());
    let mut alone = Engine::on_device(device()).renderer(&world, &options).unwrap();
    let (_, same) = alone.draw_range(&camera, range("64-128"), || ()).unwrap();
    assert!(later.picture == same.picture);
}

#[test]
fn a_device_that_fails_leaves_its_work_to_the_others() {
    for (integrator, n_samples) in [(Integrator::Path, 64), (Integrator::Whitted, 1)] {
        let options = RenderOptions { integrator, denoise: Denoise::Off, max_depth: 2, ..RenderOptions::default() };
        let options = RenderOptions { width: 32, height: 24, ..options };
        let world = world();
        let [(one, _), _] = draw(vec![device()], &world, &options, n_samples);
        let contexts = [device(), device()];
        let mut renderer = Engine::on_devices(contexts.to_vec()).renderer(&world, &options).unwrap();
        contexts[1].fail_creations_after(Some(0));
        assert!(draw_next(&mut renderer, &world, n_samples).0 == one);
        // The second picture is drawn without it.
        assert!(draw_next(&mut renderer, &world, n_samples).0 == one);
        // The last device remains, and its failure is the picture's.
        contexts[0].fail_creations_after(Some(0));
        assert!(renderer.draw(&world.scene().camera, Goal::Samples(n_samples), || ()).is_err(), "no device is left");
        contexts.iter().for_each(|context| context.fail_creations_after(None));
    }
}

/// Pictures of few samples, whose columns are shared, and of many, whose samples are, may follow each other.
#[test]
fn numbers_of_samples_may_alternate() {
    let options = RenderOptions { integrator: Integrator::Path, denoise: Denoise::Off, ..RenderOptions::default() };
    let options = RenderOptions { width: 24, height: 18, max_depth: 2, ..options };
    let world = world();
    let camera = world.scene().camera;
    let mut alone = Engine::on_device(device()).renderer(&world, &options).unwrap();
    let mut several = Engine::on_devices(vec![device(), device(), device()]).renderer(&world, &options).unwrap();
    for n_samples in [64, 8, 32, 8, 64] {
        let pictures = [&mut alone, &mut several].map(|renderer| {
            renderer.draw(&camera, Goal::Samples(n_samples), || ()).unwrap();
            renderer.picture().unwrap().into_owned()
        });
        assert!(pictures[0] == pictures[1], "{n_samples} samples");
    }
    for range in ["0-48", "16-64", "0-48"] {
        let sums = [&mut alone, &mut several]
            .map(|renderer| renderer.draw_range(&camera, range.parse().unwrap(), || ()).unwrap().1.picture);
        assert!(sums[0] == sums[1], "{range}");
    }
    // Each seed has samples of its own.
    let [of_alone, of_several] = [&mut alone, &mut several].map(|renderer| {
        [(5, 48), (5, 8), (0, 48), (0, 8)].map(|(seed, n_samples)| {
            renderer.set_seed(seed).unwrap();
            renderer.draw(&camera, Goal::Samples(n_samples), || ()).unwrap();
            renderer.picture().unwrap().into_owned()
        })
    });
    assert!(of_alone == of_several && of_alone[0] != of_alone[2] && of_alone[1] != of_alone[3]);
    assert!(several.set_seed(1 << 15).unwrap_err().to_string().contains("seed is 32768, not at most 32767"));
    // Samples that are drawn one by one have any index.
    let range = "16-39".parse().unwrap();
    for renderer in [&mut alone, &mut several] {
        let together = renderer.draw_range(&camera, range, || ()).unwrap().1;
        let apart = renderer.draw_moments(range, |_, _| Ok::<_, GpuError>(camera), || ()).unwrap().1;
        assert!(apart.picture == together.picture);
    }
}

/// Pictures that a device draws in several bands have them again in the next picture.
#[test]
fn bands_are_drawn_again() {
    let options = RenderOptions { integrator: Integrator::Path, denoise: Denoise::Off, ..RenderOptions::default() };
    let options = RenderOptions { width: 64, height: 96, max_depth: 2, ..options };
    let world = world();
    let [(one, _), _] = draw(vec![device()], &world, &options, 32);
    let small = || pretended(DeviceOverrides { storage_range: Some(64 * 128 * 50), ..DeviceOverrides::default() });
    for (picture, _) in draw(vec![small(), small()], &world, &options, 32) {
        assert!(picture == one);
    }
}

/// The watcher is told of a sample once, also if a device draws its tile in several bands.
#[test]
fn bands_of_a_tile_count_once() {
    let options = RenderOptions { width: 64, height: 384, ..RenderOptions::default() };
    let world = world();
    let small = || pretended(DeviceOverrides { storage_range: Some(1 << 16), ..DeviceOverrides::default() });
    let alone = Engine::on_device(small()).renderer(&world, &options).unwrap();
    assert!(alone.n_bands() > 4, "{}", alone.n_bands());
    draw(vec![small(), small()], &world, &options, 3);
}

/// Each device may fail at any time: between two samples of a range, when the other has done all of its work, or when
/// it encodes the joined picture, which the first device does.
#[test]
fn a_device_may_fail_at_any_time() {
    let options = RenderOptions { integrator: Integrator::Path, denoise: Denoise::Off, ..RenderOptions::default() };
    let options = RenderOptions { width: 32, height: 16, max_depth: 1, ..options };
    let world = world();
    let contexts = [device(), device()];
    // Samples of the first picture are shared, and rows of the second.
    for (n_samples, steps) in [(48, [2, 4]), (8, [4, 6])] {
        let [(one, _), _] = draw(vec![device()], &world, &options, n_samples);
        for (failing, step) in contexts.iter().zip(steps) {
            let has_failed = |n_creations| {
                let mut renderer = Engine::on_devices(contexts.to_vec()).renderer(&world, &options).unwrap();
                failing.fail_creations_after(Some(n_creations));
                let (picture, drawn) = draw_next(&mut renderer, &world, n_samples);
                failing.fail_creations_after(None);
                assert!(picture == one, "{n_samples} samples, after {n_creations} creations");
                !drawn.profile.device.starts_with("2 x ")
            };
            // On a busy machine the other device may do all of the work, and this one does not fail then.
            let (mut n_failures, mut n_successes) = (0, 0);
            for n_creations in (0..).step_by(step) {
                let failed = has_failed(n_creations);
                n_failures += u32::from(failed);
                n_successes = if failed { 0 } else { n_successes + 1 };
                if n_successes == 2 {
                    break;
                }
            }
            assert!(n_failures > 3, "{n_samples} samples: {n_failures}");
        }
    }
}

/// Returns the cameras of a film's frames.
fn cameras(world: &World, n_frames: u32) -> Vec<Camera> {
    let camera = world.scene().camera;
    (0..n_frames).map(|ix| Camera { eye: camera.eye + 0.05 * ix as f32 * Vec3::X, ..camera }).collect()
}

/// What is known of a film after it was drawn.
struct DrawnFilm<E> {
    frames: Result<Vec<Picture>, E>,
    /// Number of samples that the watcher was told of.
    n_samples: u32,
    /// For each device that failed, the number of samples of the frame that it had drawn.
    failures: Vec<u32>,
}

/// Number of samples of a frame of a film.
const FRAME_SAMPLES: u32 = 3;

/// Draws a film, of which each of the `n_devices` devices draws a frame at least.
fn draw_film<E: From<GpuError> + Send>(
    film: &mut FilmRenderer,
    n_devices: usize,
    cameras: &[Camera],
    finish: impl Fn(u32, Picture) -> Result<Picture, E> + Sync,
) -> DrawnFilm<E> {
    let (mut samples, failures) = (Samples::default(), Mutex::new(Vec::new()));
    let (all_begin, n_begun) = (Barrier::new(n_devices), AtomicUsize::new(0));
    let draw = |renderer: &mut Renderer, frame_ix: u32, tell_sample: &dyn Fn()| {
        // A device could draw all frames before the thread of another one begins.
        if n_begun.fetch_add(1, Ordering::Relaxed) < n_devices {
            all_begin.wait();
        }
        let mut n_drawn = 0;
        let watcher = || {
            n_drawn += 1;
            tell_sample();
        };
        let drawn = renderer.draw(&cameras[frame_ix as usize], Goal::Samples(FRAME_SAMPLES), watcher);
        let picture = drawn.and_then(|_| Ok(renderer.picture()?.into_owned()));
        if picture.is_err() {
            failures.lock().unwrap().push(n_drawn);
        }
        picture
    };
    let frames = film.draw(cameras.len() as u32, &mut &mut samples, draw, finish);
    DrawnFilm { frames, n_samples: samples.n_samples, failures: failures.into_inner().unwrap() }
}

/// The frames of a film have the bits of one device's, in their order, also if a device fails at any time.
#[test]
fn a_film_outlives_a_device() {
    let options = RenderOptions { width: 32, height: 24, ..RenderOptions::default() };
    let world = world();
    let cameras = cameras(&world, 4);
    let mut alone = Engine::on_device(device()).renderer(&world, &options).unwrap();
    let expected: Vec<_> = (cameras.iter())
        .map(|camera| {
            alone.draw(camera, Goal::Samples(FRAME_SAMPLES), || ()).unwrap();
            alone.picture().unwrap().into_owned()
        })
        .collect();
    assert!(expected[0] != expected[1]);
    let contexts = [device(), device()];
    let engine = Engine::on_devices(contexts.to_vec());
    let whole = |_: u32, picture: Picture| Ok::<_, GpuError>(picture);
    let mut all_failures = Vec::new();
    // Films that fail at each creation would take minutes, and fail alike.
    for n_creations in (0..).step_by(3) {
        let mut film = engine.film_renderer(&world, &options).unwrap();
        contexts[1].fail_creations_after(Some(n_creations));
        let first = draw_film(&mut film, 2, &cameras, whole);
        contexts[1].fail_creations_after(None);
        let second = draw_film(&mut film, 2 - first.failures.len(), &cameras, whole);
        for film in [&first, &second] {
            assert!(film.frames.as_ref().unwrap() == &expected, "after {n_creations} creations");
            assert_eq!(film.n_samples, 4 * FRAME_SAMPLES, "samples that the watcher is told of");
        }
        assert!(second.failures.is_empty());
        if first.failures.is_empty() {
            break;
        }
        all_failures.extend(first.failures);
    }
    // Devices failed before the first sample of a frame, within it, and after it.
    assert!((0..=FRAME_SAMPLES).all(|n_drawn| all_failures.contains(&n_drawn)), "{all_failures:?}");
    let mut film = engine.film_renderer(&world, &options).unwrap();
    contexts.iter().for_each(|context| context.fail_creations_after(Some(0)));
    assert!(draw_film(&mut film, 2, &cameras, whole).frames.is_err(), "no device is left");
    contexts.iter().for_each(|context| context.fail_creations_after(None));
}

/// The watcher is told of each frame that ends at a noise once, also if the devices draw other pictures in bands.
#[test]
fn frames_that_end_at_a_noise_count_once() {
    let options = RenderOptions { integrator: Integrator::Path, denoise: Denoise::Off, ..RenderOptions::default() };
    let options = RenderOptions { width: 64, height: 96, max_depth: 1, ..options };
    let world = world();
    let small = || pretended(DeviceOverrides { storage_range: Some(64 * 128 * 50), ..DeviceOverrides::default() });
    let mut film = Engine::on_devices(vec![small(), small()]).film_renderer(&world, &options).unwrap();
    let (mut samples, goal) = (Samples::default(), NoiseGoal { noise: 0.1, most_samples: 32 });
    let camera = world.scene().camera;
    let draw = |renderer: &mut Renderer, _: u32, tell_sample: &dyn Fn()| {
        let noisy = renderer.draw_until(&camera, goal, tell_sample)?;
        Ok((renderer.n_bands(), noisy.picture))
    };
    let frames = film.draw(4, &mut &mut samples, draw, |_, drawn| Ok::<_, GpuError>(drawn)).unwrap();
    assert!(frames.iter().all(|frame| frame.0 > 1 && *frame == frames[0]), "all frames are drawn in bands, and equal");
    assert_eq!(samples.n_samples, 4, "frames that the watcher is told of");
}

/// A frame that cannot be written ends the film: no device begins a further frame.
#[test]
fn an_error_of_writing_ends_a_film() {
    let options = RenderOptions { width: 8, height: 6, ..RenderOptions::default() };
    let world = world();
    let cameras = cameras(&world, 16);
    let mut film = Engine::on_devices(vec![device(), device()]).film_renderer(&world, &options).unwrap();
    let (n_written, is_refused) = (AtomicU32::new(0), AtomicBool::new(false));
    let refuse_third = |frame_ix: u32, picture: Picture| {
        n_written.fetch_add(1, Ordering::Relaxed);
        if frame_ix == 2 {
            is_refused.store(true, Ordering::Relaxed);
            return Err(GpuError::NoDriver);
        }
        // Frames after the third are not written before the film knows that it ends.
        while frame_ix > 2 && !is_refused.load(Ordering::Relaxed) {
            thread::yield_now();
        }
        thread::sleep(Duration::from_millis(if frame_ix > 2 { 500 } else { 0 }));
        Ok(picture)
    };
    let frames = draw_film(&mut film, 2, &cameras, refuse_third).frames;
    assert!(matches!(frames, Err(GpuError::NoDriver)), "{frames:?}");
    let n_written = n_written.into_inner();
    assert!((3..=5).contains(&n_written), "{n_written} frames");
}

/// The command writes the same files of a film with several devices as with one.
#[test]
fn the_command_draws_the_frames_of_a_film_apart() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let keyframe =
        |frame: u32, x: f32| format!("[[keyframe]]\nframe = {frame}\neye = [{x}, 1, 3]\ntarget = [0, 1, 0]\n");
    fs::write(path.join("path.toml"), keyframe(0, 0.0) + &keyframe(4, 0.5)).unwrap();
    let scene = cornell();
    let render = |folder: &str, device: &str, more: &[&str]| {
        fs::create_dir_all(path.join(folder)).unwrap();
        let output = format!("{folder}/f.####.png");
        let common = ["render", &scene, "--size", "40x30", "--path", "path.toml", "-o", &output, "--device", device];
        succeed(path, &[&common, more].concat())
    };
    for more in [&["--spp", "2", "--aov", "depth"][..], &["--integrator", "path", "--spp", "16", "--denoise", "edge"]] {
        render("one", "0", more);
        let output = render("two", "0,0", more);
        assert!(stdout(&output).contains("2 devices: each drew whole frames"), "{}", stdout(&output));
        assert!(stdout(&output).contains("the median of 5 frames"), "{}", stdout(&output));
        let names = names(&path.join("one"));
        assert_eq!(names.iter().filter(|name| name.ends_with(".png")).count(), 5);
        for name in &names {
            assert!(bytes(&path.join("one"), name) == bytes(&path.join("two"), name), "{name}");
        }
    }
    // Three frames are too few for two devices to draw them apart.
    let output = render("few", "0,0", &["--frames", "0-2"]);
    assert!(stdout(&output).contains("2 devices: the times of passes are sums over all"), "{}", stdout(&output));
    assert!(bytes(&path.join("few"), "f.0002.png") != bytes(&path.join("few"), "f.0000.png"));
}

#[test]
fn the_command_shares_pictures_among_devices() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let scene = cornell();
    let render = |output: &str, device: &str, more: &[&str]| {
        let common = ["render", &scene, "--size", "40x30", "-o", output, "--device", device];
        succeed(path, &[&common, more].concat())
    };
    for more in [&["--spp", "2"][..], &["--integrator", "path", "--spp", "32"], &["--aov", "depth,cost"]] {
        render("one.png", "0", more);
        let output = render("two.png", "0,0", more);
        assert!(stdout(&output).contains("2 devices: the times of passes are sums over all"), "{}", stdout(&output));
        assert!(stdout(&output).contains(" on 2 x "), "{}", stdout(&output));
        assert!(!stderr(&output).contains("of several kinds"), "{}", stderr(&output));
        assert!(bytes(path, "one.png") == bytes(path, "two.png"), "{more:?}");
    }
    render("all.png", "all", &["--aov", "depth,cost"]);
    assert!(bytes(path, "one.png") == bytes(path, "all.png"));
    let refused = |more: &[&str], named: &str| {
        fail(path, &[&["render", &scene, "--size", "8x6", "--device", "0,0"], more].concat(), 2, named);
    };
    refused(&["--time", "1s"], "--time needs a single device");
    refused(&["--trace", "t.json"], "--trace needs a single device");
    fail(path, &["render", &scene, "--device", "0,none"], 4, "no Vulkan device `none`");
}

fn bytes(directory: &Path, name: &str) -> Vec<u8> {
    fs::read(directory.join(name)).unwrap()
}
