//! `kdray render`: scene file to picture.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use kdray::{
    cpu::{self, Batching},
    frame::{Aov, Picture, Profile, RenderOptions},
    gpu::{Context, ContextOptions, GpuError},
    kdtree::{BuildOptions, KdTree},
    layout::Feature,
    output::{self, Format, HeatMap},
    render::Renderer,
    scene::Scene,
};

use super::{
    args::RenderArgs,
    complain,
    error::CliError,
    open_device, print,
    progress::{Progress, Steps},
    report::{Report, Spread},
};

/// Loads, builds, renders, writes and reports. What can be refused is refused before the work that it would waste.
pub fn run(args: &RenderArgs) -> Result<(), CliError> {
    args.check()?;
    check_outputs(args)?;
    set_threads(args.threads)?;

    let progress = Progress::new(args.quiet, 3);
    let (scene, load_ms) = progress.stage(&format!("loading {}", args.scene.display()), || Scene::load(&args.scene));
    let scene = scene?;
    let picture_path = args.output.clone().unwrap_or_else(|| default_output(&scene.name));
    let extra = ExtraFiles::of(&picture_path, &args.aov);
    for path in extra.layers.iter().chain(&extra.heat_map).chain([&picture_path]) {
        output::check(path)?;
    }
    let options = args.options(&scene.defaults)?;
    let device = ContextOptions { device: args.device.clone(), validate: args.validate };
    let context = if args.cpu { None } else { Some(open_device(&device, &progress)?) };

    let n_triangles = scene.triangles.len();
    let build_options = BuildOptions::default();
    let building = format!("building the kd-tree of {n_triangles} triangles");
    let (tree, build_ms) = progress.stage(&building, || KdTree::build(&scene.triangles, &build_options));
    let crop = options.crop_or_whole();
    let rendering = format!("rendering {}x{}", crop.width(), crop.height());
    let frame = FrameToDraw { scene: &scene, tree: &tree, options: &options, n_samples: args.spp };
    let mut steps = progress.steps(&rendering, args.spp * u32::from(args.repeat));
    let (drawn, render_ms) = progress.stage(&rendering, || frame.draw(context.as_ref(), args.repeat, &mut steps));
    let Drawn { picture, features, profiles } = drawn?;
    extra.write(&args.aov, &picture, &features)?;
    if extra.layers.as_ref() != Some(&picture_path) {
        output::write_picture(&picture_path, &picture)?;
    }
    drop(progress);

    let report = Report {
        scene: scene.name,
        extra_files: extra.beside(&picture_path),
        picture: picture_path,
        options: (&options).into(),
        samples: args.spp,
        triangles: n_triangles,
        tree: tree.statistics(n_triangles, &build_options),
        load_ms,
        build_ms,
        render_ms,
        repeated: Spread::of(&profiles),
        frame: median(profiles).into(),
    };
    if let Some(path) = &args.profile {
        output::write(path, &report.json())?;
    }
    if !args.quiet {
        print(&report.text())?;
    }
    context.map_or(Ok(()), |context| report_validation(&context))
}

/// Refuses targets that cannot be written, as far as they are known before the scene is.
fn check_outputs(args: &RenderArgs) -> Result<(), CliError> {
    if let Some(path) = &args.output {
        Format::of(path)?;
        output::check(path)?;
    }
    if let Some(path) = &args.profile {
        output::check(path)?;
    }
    Ok(())
}

/// Sizes the pool for everything that follows.
pub(super) fn set_threads(n_threads: Option<u16>) -> Result<(), CliError> {
    let Some(n_threads) = n_threads else { return Ok(()) };
    (rayon::ThreadPoolBuilder::new().num_threads(n_threads.into()).build_global())
        .map_err(|error| CliError::Usage(format!("--threads {n_threads}: {error}")))
}

/// A PNG of the scene's name in the working directory.
fn default_output(scene_name: &str) -> PathBuf {
    format!("{}.png", output::stem_of(scene_name)).into()
}

struct FrameToDraw<'a> {
    scene: &'a Scene,
    tree: &'a KdTree,
    options: &'a RenderOptions,
    /// A pixel.
    n_samples: u32,
}

impl FrameToDraw<'_> {
    /// Draws the frame so many times, on the device or on the CPU for want of one. The pictures are all the same.
    fn draw(&self, context: Option<&Arc<Context>>, n_times: u16, steps: &mut Steps) -> Result<Drawn, GpuError> {
        let with_features = self.options.features;
        let (mut profiles, mut features) = (Vec::new(), Vec::new());
        let Some(context) = context else {
            let mut renderer = cpu::Renderer::new(self.scene, self.tree, self.options, Batching::default());
            for _ in 0..n_times {
                renderer.reset_samples();
                profiles.push(self.add_up(steps, |sample_ix| {
                    let profile = renderer.draw_sample();
                    if with_features && sample_ix == 0 {
                        features = renderer.features();
                    }
                    Ok(profile)
                })?);
            }
            return Ok(Drawn { picture: renderer.picture(), features, profiles });
        };
        let mut renderer = Renderer::new(Arc::clone(context), self.scene, self.tree, self.options)?;
        for _ in 0..n_times {
            renderer.reset_samples();
            profiles.push(self.add_up(steps, |sample_ix| {
                let profile = renderer.draw_sample()?;
                if with_features && sample_ix == 0 {
                    features = renderer.features()?;
                }
                Ok(profile)
            })?);
        }
        Ok(Drawn { picture: renderer.picture()?, features, profiles })
    }

    /// Draws all samples; their profiles together.
    fn add_up(
        &self,
        steps: &mut Steps,
        mut draw_sample: impl FnMut(u32) -> Result<Profile, GpuError>,
    ) -> Result<Profile, GpuError> {
        let mut sum = draw_sample(0)?;
        steps.step();
        for sample_ix in 1..self.n_samples {
            sum.add(&draw_sample(sample_ix)?);
            steps.step();
        }
        Ok(sum)
    }
}

/// What comes of it.
struct Drawn {
    picture: Picture,
    /// Of the first sample, at the pixels' centres; empty where the options do not ask for them.
    features: Vec<Feature>,
    /// One a repetition.
    profiles: Vec<Profile>,
}

/// What is written beside the picture.
struct ExtraFiles {
    /// The picture with layers; the picture itself where that is an .exr.
    layers: Option<PathBuf>,
    /// The costs in colours.
    heat_map: Option<PathBuf>,
}

impl ExtraFiles {
    fn of(picture: &Path, aovs: &[Aov]) -> Self {
        let is_exr = picture.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr"));
        let layers = if is_exr { picture.to_owned() } else { picture.with_extension("exr") };
        Self {
            layers: (!aovs.is_empty()).then_some(layers),
            heat_map: aovs.contains(&Aov::Cost).then(|| picture.with_extension("cost.png")),
        }
    }

    fn write(&self, aovs: &[Aov], picture: &Picture, features: &[Feature]) -> Result<(), CliError> {
        if let Some(path) = &self.layers {
            output::write_layers(path, picture, aovs, features)?;
        }
        if let Some(path) = &self.heat_map {
            let values = features.iter().map(|feature| feature.n_steps).collect();
            HeatMap { title: "steps a pixel", width: picture.width, height: picture.height, values }.write(path)?;
        }
        Ok(())
    }

    /// All but the picture.
    fn beside(self, picture: &Path) -> Vec<PathBuf> {
        self.layers.into_iter().chain(self.heat_map).filter(|path| path != picture).collect()
    }
}

/// The frame of median time; the last one where the device has no timestamps.
fn median(mut profiles: Vec<Profile>) -> Profile {
    profiles.sort_by(|a, b| a.frame_ms.partial_cmp(&b.frame_ms).expect("times are numbers"));
    profiles.swap_remove(profiles.len() / 2)
}

/// Lists what the validation layer said; anything is a failure.
pub(super) fn report_validation(context: &Context) -> Result<(), CliError> {
    let messages = context.validation_messages();
    for message in &messages {
        complain("validation", message);
    }
    if messages.is_empty() { Ok(()) } else { Err(CliError::Validation(messages.len())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_s_name_stays_in_the_working_directory() {
        for (name, file) in [("cornell", "cornell.png"), ("../a", "..-a.png"), ("", "picture.png")] {
            assert_eq!(default_output(name), PathBuf::from(file));
        }
    }
}
