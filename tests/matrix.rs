//! Tests that every combination of integrator, engine, noise filter, layers, format and part of a picture either gives
//! a picture whose layers are all sound, or is refused before anything is drawn.

mod support;

use std::path::Path;

use exr::prelude::{AnyChannel, FlatSamples, ReadChannels, ReadLayers};
use glam::vec3;
use kdray::{
    engine::{Engine, NoiseGoal, NoisePicture, Renderer, choices::Workload},
    frame::{Aov, Channel, Crop, Denoise, Drawn, Goal, Integrator, Picture, RenderOptions, SampleRange, Samples},
    output::{self, HeatMap, Layers},
    world::World,
};
use rayon::prelude::*;
use support::{
    command::{cornell, fail, names, succeed},
    device, meshes, scenes, world_of,
};
use tempfile::TempDir;

/// The size of the whole picture, pixels.
const WIDTH: u32 = 16;
const HEIGHT: u32 = 12;

/// What the file of a picture has to hold.
struct Expected {
    size: (u32, u32),
    /// None if it depends on the time or on the noise.
    n_samples: Option<u32>,
    aovs: Vec<Aov>,
    /// Whether the picture is a part of a whole, in which lamps, other materials and other walls may be missing.
    is_part: bool,
}

impl Expected {
    /// Returns the names of the channels, in alphabetical order.
    fn names(&self) -> Vec<String> {
        let colour = |prefix: String| ["B", "G", "R"].map(|component| format!("{prefix}{component}"));
        let of_aov = |aov: &Aov| match aov.is_of_means() {
            true if *aov == Aov::Normal => ["X", "Y", "Z"].map(|component| format!("{aov}.{component}")).to_vec(),
            true => colour(format!("{aov}.")).to_vec(),
            false if *aov == Aov::Motion => ["motion.X", "motion.Y"].map(str::to_owned).to_vec(),
            false => aov.channels(&[]).into_iter().map(|channel| channel.name).collect(),
        };
        let mut names: Vec<_> = self.aovs.iter().flat_map(of_aov).chain(colour(String::new())).collect();
        names.sort();
        names
    }

    /// Returns what is wrong with the channels of a file, none if they are as expected.
    fn fault(&self, channels: &[Channel]) -> Option<String> {
        let names: Vec<_> = channels.iter().map(|channel| channel.name.as_str()).collect();
        if names != self.names() {
            return Some(format!("channels {names:?}, not {:?}", self.names()));
        }
        let fault = |channel: &Channel| Some(format!("{}: {}", channel.name, self.fault_of_channel(channel)?));
        channels.iter().find_map(fault)
    }

    fn fault_of_channel(&self, channel: &Channel) -> Option<String> {
        let values: Vec<f64> = match &channel.samples {
            Samples::Float(values) => values.iter().map(|value| f64::from(*value)).collect(),
            Samples::Uint(values) => values.iter().map(|value| f64::from(*value)).collect(),
        };
        if values.len() != self.size.0 as usize * self.size.1 as usize {
            return Some(format!("{} values for {:?} pixels", values.len(), self.size));
        }
        let (layer, _) = channel.name.split_once('.').unwrap_or_default();
        let is_sound = |value: &f64| match layer {
            "samples" => *value >= 1.0 && self.n_samples.is_none_or(|n| *value == f64::from(n)),
            "rays" => *value >= 1.0,
            // Nothing is hit there.
            "depth" => *value > 0.0,
            // A single sample tells nothing of the noise.
            "variance" if self.n_samples.is_none_or(|n| n == 1) => *value >= 0.0,
            "normal" => value.abs() <= 1.0 + 1e-6,
            "position" => value.is_finite(),
            // Nothing moves in single pictures.
            "motion" => *value == 0.0,
            _ => value.is_finite() && *value >= 0.0,
        };
        if let Some(wrong) = values.iter().find(|value| !is_sound(value)) {
            return Some(format!("the value {wrong}"));
        }
        let may_vanish = self.is_part && ["emission", "normal", "id", "material"].contains(&layer);
        let is_told = |value: &f64| *value != 0.0 && (layer != "depth" || value.is_finite());
        (!may_vanish && layer != "motion" && !values.iter().any(is_told)).then(|| "no value says anything".to_owned())
    }

    /// Checks the files of a picture: its own, that of the layers, and the heat map.
    fn check(&self, picture: &Path, case: &str) {
        let layers = picture.with_extension("exr");
        if picture == layers || !self.aovs.is_empty() {
            assert_eq!(self.fault(&channels_of(&layers)), None, "{case}");
        }
        if picture != layers {
            let shown = image::open(picture).unwrap().into_rgb8();
            assert_eq!(shown.dimensions(), self.size, "{case}");
            assert!(shown.pixels().any(|pixel| pixel.0 != [0; 3]), "{case}: black");
        }
        let heat_map = picture.with_extension("cost.png");
        assert_eq!(heat_map.exists(), self.aovs.contains(&Aov::Cost), "{case}");
        if heat_map.exists() {
            let (width, height) = image::image_dimensions(&heat_map).unwrap();
            assert!(width > self.size.0 && height > self.size.1, "{case}");
        }
    }
}

/// Returns the channels of an OpenEXR file, without sums of blocks of samples.
fn channels_of(path: &Path) -> Vec<Channel> {
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.first_valid_layer().all_attributes().from_file(path).unwrap();
    let channel = |channel: &AnyChannel<FlatSamples>| Channel {
        name: channel.name.to_string(),
        samples: match &channel.sample_data {
            FlatSamples::F32(values) => Samples::Float(values.clone()),
            FlatSamples::U32(values) => Samples::Uint(values.clone()),
            FlatSamples::F16(_) => panic!("no halves"),
        },
    };
    let channels = image.layer_data.channel_data.list.iter().map(channel);
    channels.filter(|channel| !channel.name.contains("sum ")).collect()
}

const FILTERS: [(&str, Denoise); 3] = [
    ("off", Denoise::Off),
    ("paper", Denoise::Paper { threshold: Denoise::DEFAULT_THRESHOLD }),
    ("edge", Denoise::Edge),
];

/// An integrator, and a noise filter with its word.
type Kind = (Integrator, (&'static str, Denoise));

/// Returns the pairs of integrator and noise filter that can be combined.
fn kinds() -> impl Iterator<Item = Kind> {
    let pairs = Integrator::ALL.iter().flat_map(|&integrator| FILTERS.map(|filter| (integrator, filter)));
    pairs.filter(|&(integrator, (_, denoise))| can_combine(integrator, denoise, None))
}

/// Whether an integrator has a noise filter and a layer.
fn can_combine(integrator: Integrator, denoise: Denoise, aov: Option<Aov>) -> bool {
    integrator == Integrator::Path || (denoise != Denoise::Edge && !aov.is_some_and(Aov::is_of_paths))
}

/// Returns the layers that pictures have, those that show AOVs or those of light.
fn aovs_of(options: &RenderOptions) -> Vec<Aov> {
    let is_asked = |aov: &&Aov| match aov {
        aov if aov.is_of_light() => options.light_layers,
        aov if aov.is_of_means() => options.surface_layers,
        _ => options.pixel_aovs,
    };
    let aovs = Aov::ALL.iter().filter(is_asked).copied();
    aovs.filter(|&aov| can_combine(options.integrator, options.denoise, Some(aov))).collect()
}

/// A world of everything that a layer can show.
fn world() -> World {
    let mut scene = scenes::mixed_outdoors();
    scenes::add(&mut scene, meshes::torus(6, 5), scenes::emissive(vec3(3.0, 2.0, 1.0)));
    world_of(&scene)
}

/// Writes a picture in all formats, and checks the files.
fn write_and_check(options: &RenderOptions, n_samples: Option<u32>, (picture, drawn): (&Picture, &Drawn), case: &str) {
    let directory = TempDir::new().unwrap();
    let aovs = aovs_of(options);
    let means = drawn.layers.0.each_ref().map(Vec::as_slice);
    let (pixel_aovs, motion) = (&drawn.pixel_aovs, &vec![[0.0; 2]; drawn.pixel_aovs.len()]);
    let layers = Layers { aovs: &aovs, pixel_aovs, motion, means, ..Layers::default() };
    let path = directory.path().join("x.png");
    let written = output::write_layers(&path.with_extension("exr"), picture, &layers);
    written.and_then(|()| output::write_picture(&path, picture)).unwrap_or_else(|error| panic!("{case}: {error}"));
    if options.pixel_aovs {
        let values = drawn.pixel_aovs.iter().map(|aovs| aovs.n_steps).collect();
        let map = HeatMap { title: "steps a pixel", width: picture.width, height: picture.height, values };
        map.write(&path.with_extension("cost.png")).unwrap();
    }
    let crop = options.crop_or_whole();
    let size = (crop.width(), crop.height());
    let expected = Expected { size, n_samples, aovs, is_part: options.crop.is_some() };
    [&path, &path.with_extension("exr")].into_iter().for_each(|path| expected.check(path, case));
}

/// Draws some samples of the picture, and draws it until there is little noise.
fn check_ranges(renderer: &mut Renderer, world: &World, options: &RenderOptions, case: &str) {
    let camera = &world.scene().camera;
    let (drawn, sums) = renderer.draw_range(camera, SampleRange { first: 16, end: 64 }, || ()).unwrap();
    let radiance = sums.picture.mean();
    let display = kdray::cpu::display(&radiance, 1.0, options.tonemap);
    let (width, height) = (options.crop_or_whole().width(), options.crop_or_whole().height());
    let picture = Picture { width, height, radiance, display };
    write_and_check(options, Some(48), (&picture, &drawn), &format!("{case}, some samples"));
    let goal = NoiseGoal { noise: 0.02, most_samples: 64 };
    let NoisePicture { picture, drawn, .. } = renderer.draw_until(camera, goal, || ()).unwrap();
    write_and_check(options, None, (&picture, &drawn), &format!("{case}, until a noise"));
}

/// Draws pictures of these kinds. `crops`: parts of the picture to draw, and none for all of it. `layers`: whether
/// pictures have AOVs, and whether they have layers of light.
fn check_engine(engine: &Engine, kinds: impl Iterator<Item = Kind>, crops: &[Option<Crop>], layers: &[(bool, bool)]) {
    let world = &world();
    for (integrator, (filter, denoise)) in kinds {
        for (&(pixel_aovs, light_layers), &crop) in
            layers.iter().flat_map(|layers| crops.iter().map(move |crop| (layers, crop)))
        {
            let (width, height, max_depth) = (WIDTH, HEIGHT, 3);
            let of_picture = RenderOptions { width, height, crop, max_depth, ..RenderOptions::default() };
            let options = RenderOptions {
                integrator,
                denoise,
                pixel_aovs,
                light_layers,
                surface_layers: pixel_aovs,
                ..of_picture
            };
            let workload = Workload::of_pictures(&options, world.scene().lights.len(), 1);
            let options = engine.methods(world, &workload).unwrap().apply(&options);
            let mut renderer = engine.renderer(world, &options).unwrap();
            let case = format!("{}, {integrator}, {filter}, {crop:?}, {:?}", engine.device_name(), aovs_of(&options));
            for n_samples in [1, 5, 33] {
                let drawn = renderer.draw(&world.scene().camera, Goal::Samples(n_samples), || ()).unwrap();
                let picture = renderer.picture().unwrap();
                let case = format!("{case}, {n_samples} samples");
                write_and_check(&options, Some(n_samples), (&picture, &drawn), &case);
            }
            if (integrator, denoise) == (Integrator::Path, Denoise::Off) {
                check_ranges(&mut renderer, world, &options, &case);
            }
        }
    }
    engine.devices().for_each(|device| assert_eq!(device.validation_messages(), Vec::<String>::new()));
}

const INNER: Option<Crop> = Some(Crop { x0: 3, y0: 2, x1: 9, y1: 11 });
const ROWS: Option<Crop> = Some(Crop { x0: 0, y0: 4, x1: WIDTH, y1: 8 });

#[test]
fn the_cpu_draws_all_that_it_is_asked_for() {
    let whole_as_crop = Some(Crop::whole(WIDTH, HEIGHT));
    let layers = [(false, false), (true, false), (false, true), (true, true)];
    check_engine(&Engine::on_cpu(), kinds(), &[None, INNER, ROWS, whole_as_crop], &layers);
}

#[test]
fn a_device_draws_all_that_it_is_asked_for() {
    check_engine(&Engine::on_device(device()), kinds(), &[None, INNER], &[(true, true)]);
}

/// How several devices share a picture depends on its samples and on the reach of the filter. Drivers in software take
/// long to compile kernels, so only the two extremes are drawn.
#[test]
fn several_devices_draw_all_that_they_are_asked_for() {
    let kinds = kinds().filter(|(integrator, (filter, _))| *integrator == Integrator::Path && *filter != "paper");
    check_engine(&Engine::on_devices(vec![device(), device()]), kinds, &[None], &[(true, true)]);
}

/// Returns the arguments with which the command draws the Cornell box.
fn arguments<'a>(scene: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", scene, "--cpu", "--threads", "1", "--size", "16x12", "-q"], more].concat()
}

#[test]
fn the_command_writes_each_layer_in_each_format_or_refuses_it() {
    let scene = cornell();
    let filters = Integrator::ALL.iter().flat_map(|&integrator| FILTERS.map(|filter| (integrator, filter)));
    let aovs = filters
        .flat_map(|filter| [None].into_iter().chain(Aov::ALL.iter().copied().map(Some)).map(move |aov| (filter, aov)));
    let cases: Vec<_> = aovs.flat_map(|case| ["x.png", "x.exr"].map(|file| (case, file))).collect();
    cases.into_par_iter().for_each(|(((integrator, (filter, denoise)), aov), file)| {
        let directory = TempDir::new().unwrap();
        let words = [integrator.to_string(), aov.map_or_else(String::new, |aov| aov.to_string())];
        let of_picture = ["--integrator", &words[0], "--denoise", filter, "--spp", "5", "-o", file];
        let layer = ["--aov", &words[1]];
        let more = [&of_picture[..], if aov.is_some() { &layer[..] } else { &[] }].concat();
        if can_combine(integrator, denoise, aov) {
            succeed(directory.path(), &arguments(&scene, &more));
            let aovs = aov.into_iter().collect();
            let expected = Expected { size: (WIDTH, HEIGHT), n_samples: Some(5), aovs, is_part: false };
            expected.check(&directory.path().join(file), &format!("{more:?}"));
        } else {
            fail(directory.path(), &arguments(&scene, &more), 2, "--integrator path");
            assert!(names(directory.path()).is_empty(), "{more:?}");
        }
    });
}

/// Returns the words of `--aov` with all layers that pictures of an integrator have.
fn all_aovs(integrator: Integrator) -> (Vec<Aov>, String) {
    let aovs: Vec<_> =
        Aov::ALL.iter().copied().filter(|&aov| can_combine(integrator, Denoise::Off, Some(aov))).collect();
    let words = aovs.iter().map(Aov::to_string).collect::<Vec<_>>().join(",");
    (aovs, words)
}

#[test]
fn the_command_writes_all_layers_of_parts_of_pictures() {
    let scene = cornell();
    /// Arguments, the size that they give, and the number of samples, if it is known.
    type Part<'a> = (&'a [&'a str], (u32, u32), Option<u32>);
    let parts: [Part; 5] = [
        (&["--spp", "3", "--crop", "3,2,9,11"], (6, 9), Some(3)),
        (&["--spp", "3", "--tile", "2/3"], (16, 4), Some(3)),
        (&["--spp", "3", "--crop", "0,0,16,12", "--repeat", "2"], (16, 12), Some(3)),
        (&["--time", "1ms"], (16, 12), None),
        (&["--spp", "17", "--max-depth", "2"], (16, 12), Some(17)),
    ];
    for (integrator, (filter, _)) in kinds() {
        let (aovs, words) = all_aovs(integrator);
        for ((more, size, n_samples), file) in parts.iter().flat_map(|part| ["x.png", "x.exr"].map(|file| (part, file)))
        {
            let directory = TempDir::new().unwrap();
            let integrator = integrator.to_string();
            let of_picture = ["--integrator", &integrator, "--denoise", filter, "--aov", &words, "-o", file];
            let more = [&of_picture[..], *more].concat();
            succeed(directory.path(), &arguments(&scene, &more));
            let expected = Expected { size: *size, n_samples: *n_samples, aovs: aovs.clone(), is_part: true };
            expected.check(&directory.path().join(file), &format!("{more:?}"));
        }
    }
}

#[test]
fn the_command_joins_all_layers() {
    let scene = cornell();
    let (aovs, words) = all_aovs(Integrator::Path);
    let of_paths = ["--integrator", "path", "--denoise", "off", "--spp", "48", "--aov", &words];
    for cuts in [["--tile", "1/2", "--tile", "2/2"], ["--samples", "0-16", "--samples", "16-48"]] {
        let directory = TempDir::new().unwrap();
        for (cut, file) in cuts.chunks(2).zip(["a.exr", "b.exr"]) {
            succeed(directory.path(), &arguments(&scene, &[&of_paths[..], cut, &["-o", file]].concat()));
        }
        succeed(directory.path(), &["merge", "a.exr", "b.exr", "-o", "whole.exr", "-q"]);
        let channels = channels_of(&directory.path().join("whole.exr"));
        let expected = Expected { size: (WIDTH, HEIGHT), n_samples: Some(48), aovs: aovs.clone(), is_part: false };
        assert_eq!(expected.fault(&channels), None, "{cuts:?}");
    }
}

#[test]
fn the_command_refuses_what_cannot_be_combined() {
    let scene = cornell();
    let refused: [(&[&str], &str); 9] = [
        (&["--integrator", "path", "--denoise", "edge", "--spp", "32", "--samples", "0-16"], "--denoise off"),
        (&["--integrator", "path", "--denoise", "paper", "--spp", "32", "--samples", "0-16"], "--denoise off"),
        (&["--integrator", "whitted", "--denoise", "off", "--spp", "32", "--samples", "0-16"], "--integrator path"),
        (&["--integrator", "path", "--denoise", "edge", "--noise", "0.1"], "--denoise off"),
        (&["--integrator", "path", "--denoise", "paper", "--noise", "0.1"], "--denoise off"),
        (&["--integrator", "whitted", "--denoise", "off", "--noise", "0.1"], "--integrator path"),
        (&["--integrator", "path", "--crop", "0,0,17,12"], "reaches beyond"),
        (&["--integrator", "path", "--tile", "1/13"], "fewer than tiles"),
        (&["--integrator", "path", "--aov", "colour"], "--aov"),
    ];
    for (more, named) in refused {
        let directory = TempDir::new().unwrap();
        fail(directory.path(), &arguments(&scene, &[more, &["-o", "x.exr"]].concat()), 2, named);
        assert!(names(directory.path()).is_empty(), "{more:?}");
    }
    let directory = TempDir::new().unwrap();
    fail(directory.path(), &arguments(&scene, &["--samples", "0-16", "-o", "x.png"]), 2, ".exr");
}

/// The command itself, on a device.
#[test]
fn the_command_writes_all_layers_that_a_device_draws() {
    let scene = cornell();
    for (integrator, (filter, _)) in kinds().filter(|(_, (filter, _))| *filter != "off") {
        let directory = TempDir::new().unwrap();
        let ((aovs, words), integrator) = (all_aovs(integrator), integrator.to_string());
        let of_picture = ["--integrator", &integrator, "--denoise", filter, "--aov", &words, "-o", "x.png"];
        let of_device = ["render", &scene, "--size", "16x12", "--spp", "5", "--validate", "-q"];
        succeed(directory.path(), &[&of_device[..], &of_picture].concat());
        let expected = Expected { size: (WIDTH, HEIGHT), n_samples: Some(5), aovs, is_part: false };
        expected.check(&directory.path().join("x.png"), &format!("{of_picture:?}"));
    }
}

#[test]
fn a_faulty_layer_is_noticed() {
    let (aovs, _) = all_aovs(Integrator::Path);
    let expected = Expected { size: (2, 1), n_samples: Some(2), aovs, is_part: false };
    let channel = |name: String| match name.rsplit_once('.') {
        Some((_, "ID" | "N")) => Channel { name, samples: Samples::Uint(vec![2, 2]) },
        Some(("motion", _)) => Channel { name, samples: Samples::Float(vec![0.0; 2]) },
        _ => Channel { name, samples: Samples::Float(vec![0.0, 0.5]) },
    };
    let mut sound: Vec<_> = expected.names().into_iter().map(channel).collect();
    let depth = sound.iter().position(|channel| channel.name == "depth.Z").unwrap();
    sound[depth].samples = Samples::Float(vec![f32::INFINITY, 0.5]);
    assert_eq!(expected.fault(&sound), None);
    let spoil: [fn(&mut Samples); 3] = [
        |samples| match samples {
            Samples::Float(values) => *values = vec![0.0; 2],
            Samples::Uint(values) => *values = vec![0; 2],
        },
        |samples| match samples {
            Samples::Float(values) => values.push(1.0),
            Samples::Uint(values) => values.clear(),
        },
        |samples| *samples = Samples::Float(vec![f32::NAN, 1.0]),
    ];
    for (i, spoil) in (0..sound.len()).flat_map(|i| spoil.map(|spoil| (i, spoil))) {
        let mut spoilt = sound.clone();
        spoil(&mut spoilt[i].samples);
        if spoilt == sound {
            continue; // motion without motion
        }
        assert!(expected.fault(&spoilt).is_some_and(|fault| fault.starts_with(&sound[i].name)), "{:?}", spoilt[i]);
    }
    assert!(expected.fault(&sound[1..]).is_some());
}
