//! Arguments that say how a picture is made. `kdray render` and `kdray view` share them.

use clap::{ValueEnum, value_parser};
use kdray::{
    accel::{AccelKind, kdtree::Traversal},
    engine::choices::{BuildPolicy, Request},
    frame::{Integrator, PathOptions, PixelFilter, Primary, RenderOptions, Tonemap},
    scene::{DenoiseChoice, PictureChoices},
    world::instances::Instancing,
};

use super::{args::Size, error::CliError, or_auto::OrAuto};

#[derive(Clone, clap::Args)]
pub struct PictureArgs {
    /// Size of the picture in pixels, for example 1024x768, each side 1 to 16384 [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    #[arg(long, value_name = "NAME")]
    #[arg(help = with_words(INTEGRATOR, Some(INTEGRATOR_DEFAULT), &Integrator::words()))]
    #[arg(long_help = listed(INTEGRATOR, INTEGRATOR_DEFAULT, &Integrator::descriptions()))]
    pub integrator: Option<Integrator>,
    /// Levels of rays per pixel, 1 to 64: 1 traces primary rays only, and each further level adds one bounce of
    /// reflected and refracted rays; shadow rays are not counted [default: the scene's]
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=i64::from(RenderOptions::MOST_DEPTH)))]
    pub max_depth: Option<u32>,
    /// Noise filter for the finished picture; edge needs --integrator path [default: the scene's]
    #[arg(long, value_name = "paper|edge|off")]
    pub denoise: Option<DenoiseWord>,
    /// Threshold of the noise filter, 0 to 4: the filter smooths a pixel if its luminance differences to its four
    /// neighbours, in units of display white, add up to more than the threshold; implies --denoise paper [default:
    /// the scene's, else 2.5]
    #[arg(long, value_name = "X", value_parser = threshold)]
    pub denoise_threshold: Option<f32>,
    /// Factor on radiance before the tone curve, above 0 [default: the scene's; measured in the first view if the
    /// scene's lights have physical units, as in glTF files, or if surfaces of a mesh or glTF file light it]
    #[arg(long, value_name = "X", value_parser = positive)]
    pub exposure: Option<f32>,
    #[arg(long, value_name = "CURVE")]
    #[arg(help = with_words(TONEMAP, Some("the scene's"), &Tonemap::words()))]
    #[arg(long_help = listed(TONEMAP, "the scene's", &Tonemap::descriptions()))]
    pub tonemap: Option<Tonemap>,
    /// Most light of each contribution of a path after its first hit, in any colour, above 0; bright specks fade, and
    /// so does some of the light [default: any amount]
    #[arg(long, value_name = "RADIANCE", value_parser = positive)]
    pub clamp: Option<f32>,
    #[arg(long, value_name = "FILTER", help = with_words(FILTER, Some("tent"), &PixelFilter::words()))]
    #[arg(long_help = listed(FILTER, "tent", &PixelFilter::descriptions()))]
    pub pixel_filter: Option<PixelFilter>,
    /// Radius of the camera's lens in world units, above 0, for --integrator path: what is nearer or farther than
    /// --focus is blurred [default: 0, everything is sharp]
    #[arg(long, value_name = "R", value_parser = positive)]
    pub aperture: Option<f32>,
    /// Distance from the eye, along the view, at which things are sharp, in world units; needs --aperture [default:
    /// that of the camera's target]
    #[arg(long, value_name = "D", value_parser = positive, requires = "aperture")]
    pub focus: Option<f32>,
    #[command(flatten)]
    pub structure: StructureArgs,
    #[arg(long, value_name = "METHOD", default_value = "auto", hide_default_value = true)]
    #[arg(help = with_words(PRIMARY, Some("auto"), &format!("{}, auto", Primary::words())))]
    #[arg(long_help = primary_long_help())]
    pub primary: OrAuto<Primary>,
}

/// Arguments that choose the acceleration structure, and how rays go through it.
#[derive(Clone, clap::Args)]
pub struct StructureArgs {
    /// Whether a mesh that occurs several times is stored once: auto, flatten or keep
    #[arg(long, value_name = "KIND", long_help = instances_help(), default_value_t)]
    pub instances: Instancing,
    #[arg(long, value_name = "KIND", default_value = "auto", hide_default_value = true)]
    #[arg(help = with_words(ACCEL, Some("auto"), &format!("{}, auto", AccelKind::words())))]
    #[arg(long_help = accel_or_auto_help())]
    pub accel: OrAuto<AccelKind>,
    #[arg(long, value_name = "ALGORITHM", default_value = "auto", hide_default_value = true)]
    #[arg(help = with_words(TRAVERSAL, Some("auto"), &format!("{}, auto", Traversal::words())))]
    #[arg(long_help = traversal_long_help())]
    pub traversal: OrAuto<Traversal>,
    #[arg(long, value_name = "TREE", default_value_t = BuildPolicy::Auto, hide_default_value = true)]
    #[arg(help = with_words(BUILD, Some("auto"), &BuildPolicy::words()))]
    #[arg(long_help = listed(BUILD, "auto", &BuildPolicy::descriptions()))]
    pub build: BuildPolicy,
}

impl StructureArgs {
    /// Refuses arguments for kd-trees if the structure is a grid, and a tree of devices if there is none.
    pub fn check(&self, on_cpu: bool) -> Result<(), CliError> {
        let (accel, build) = (self.accel.pinned().unwrap_or_default(), self.build);
        check_traversal(accel, self.traversal.pinned())?;
        if accel != AccelKind::KdTree && build != BuildPolicy::Auto {
            return CliError::refuse(format!("--build chooses a kd-tree: with --accel {accel}, a grid is built"));
        }
        if on_cpu && build == BuildPolicy::Gpu {
            return CliError::refuse("--build gpu lets the device build the kd-tree: with --cpu, there is none");
        }
        Ok(())
    }

    /// Returns the user's choice of structure, build and traversal.
    pub fn request(&self) -> Request {
        let &Self { instances, accel, build, traversal } = self;
        Request { accel: accel.pinned(), build, traversal: traversal.pinned(), primary: None, instances }
    }
}

/// Returns a short help text: the option's description `what`, the words that it accepts, and its default.
pub fn with_words(what: &str, default: Option<&str>, words: &str) -> String {
    let default = default.map_or_else(String::new, |default| format!(" [default: {default}]"));
    format!("{what}: {words}{default}")
}

/// Returns a long help text: the option's description `what`, its default, and the meaning of each word that it
/// accepts.
pub fn listed(what: &str, default: &str, descriptions: &str) -> String {
    format!("{what} [default: {default}]\n\n{descriptions}")
}

const INTEGRATOR: &str = "How light is computed";
const INTEGRATOR_DEFAULT: &str = "the scene's; if its file states none, path if lights with an area, an environment or \
                                  a sky light the scene, or surfaces that shine where kdray chooses no lights; else \
                                  whitted";
const FILTER: &str = "How samples are spread around the centre of their pixel, for --integrator path";
const TONEMAP: &str = "Tone curve from radiance to what a display shows";
const ACCEL: &str = "Acceleration structure that leads rays to triangles";
const TRAVERSAL: &str = "Algorithm by which rays go through the kd-tree";
const PRIMARY: &str = "How primary rays find their triangles";
const BUILD: &str = "Which kd-tree is built";

/// Returns the help text of `--instances` with all words explained.
fn instances_help() -> String {
    format!("Whether a mesh that occurs several times is stored once:\n{}", Instancing::descriptions())
}

/// Returns the help text of `--accel`.
pub fn accel_help() -> String {
    with_words(ACCEL, Some("kdtree"), &AccelKind::words())
}

/// Returns the help text of `--accel` with all words explained.
pub fn accel_long_help() -> String {
    listed(ACCEL, "kdtree", &AccelKind::descriptions())
}

/// Returns the help text of an `--accel` that may be left open.
fn accel_or_auto_help() -> String {
    let auto = "- auto: kdtree; grid2 if meshes deform and a frame's build and rays take less time with it";
    listed(ACCEL, "auto", &format!("{}\n{auto}", AccelKind::descriptions()))
}

/// Returns the help text of `--primary` with all words explained.
fn primary_long_help() -> String {
    let auto = "- auto: what suits the device, the scene and the picture's size, or what a measurement has found to be \
                quicker";
    listed(PRIMARY, "auto", &format!("{}\n{auto}", Primary::descriptions()))
}

/// Refuses a kd-tree traversal if the structure is a grid.
pub fn check_traversal(accel: AccelKind, traversal: Option<Traversal>) -> Result<(), CliError> {
    if accel != AccelKind::KdTree && traversal.is_some() {
        return CliError::refuse(format!(
            "--traversal names an algorithm for the kd-tree: with --accel {accel}, rays go through a grid, for which \
             there is one algorithm"
        ));
    }
    Ok(())
}

/// Returns the help text of `--traversal` with all words explained.
fn traversal_long_help() -> String {
    let auto = format!(
        "- auto: {} on GPUs, {} on software drivers, {} with --cpu, or what a measurement on this GPU and scene has \
         found to be quicker",
        Traversal::OF_GPUS,
        Traversal::OF_SOFTWARE_DRIVERS,
        Traversal::OF_CPU
    );
    listed(TRAVERSAL, "auto", &format!("{}\n{auto}", Traversal::descriptions()))
}

/// Returns the help text of `--traversal` of a benchmark, which measures the default of the device.
#[cfg(feature = "bench")]
pub fn fixed_traversal_help() -> String {
    with_words(TRAVERSAL, Some(&default_traversals()), &Traversal::words())
}

/// Returns the help text of `--traversal` of a benchmark with all words explained.
#[cfg(feature = "bench")]
pub fn fixed_traversal_long_help() -> String {
    listed(TRAVERSAL, &default_traversals(), &Traversal::descriptions())
}

/// Returns the default traversals of devices and of the CPU, as a phrase of a help text.
#[cfg(feature = "bench")]
fn default_traversals() -> String {
    format!("{}, with --cpu {}", traversals_of_devices(), Traversal::OF_CPU)
}

/// Returns the default traversals of GPUs and software drivers, as a phrase of a help text.
#[cfg(feature = "bench")]
pub fn traversals_of_devices() -> String {
    format!("{}, {} on software drivers", Traversal::OF_GPUS, Traversal::OF_SOFTWARE_DRIVERS)
}

impl PictureArgs {
    /// Refuses arguments that contradict each other.
    pub fn check(&self, on_cpu: bool) -> Result<(), CliError> {
        self.structure.check(on_cpu)?;
        if let (Some(word @ (DenoiseWord::Off | DenoiseWord::Edge)), Some(_)) = (self.denoise, self.denoise_threshold) {
            let word = if word == DenoiseWord::Off { "off" } else { "edge" };
            return CliError::refuse(format!("--denoise-threshold has no meaning with --denoise {word}"));
        }
        Ok(())
    }

    /// Returns the user's choice of structure, build, traversal and primary visibility.
    pub fn request(&self) -> Request {
        Request { primary: self.primary.pinned(), ..self.structure.request() }
    }

    /// Returns what the user sets in place of the scene's options. Traversal and primary visibility depend on the
    /// device; [`Self::request`] returns the user's choice of them.
    pub fn choices(&self) -> PictureChoices {
        let paths = PathOptions::default();
        PictureChoices {
            size: self.size.map(|Size { width, height }| (width, height)),
            integrator: self.integrator,
            max_depth: self.max_depth,
            exposure: self.exposure,
            tonemap: self.tonemap,
            denoise: self.denoise(),
            paths: PathOptions {
                filter: self.pixel_filter.unwrap_or(paths.filter),
                clamp: self.clamp.unwrap_or(paths.clamp),
                aperture: self.aperture.unwrap_or(paths.aperture),
                focus: self.focus.or(paths.focus),
                ..paths
            },
        }
    }

    /// Returns the user's noise filter. `--denoise-threshold` alone turns the paper's filter on.
    fn denoise(&self) -> Option<DenoiseChoice> {
        match (self.denoise, self.denoise_threshold) {
            (None, None) => None,
            (Some(DenoiseWord::Off), _) => Some(DenoiseChoice::Off),
            (Some(DenoiseWord::Edge), _) => Some(DenoiseChoice::Edge),
            (_, threshold) => Some(DenoiseChoice::Paper(threshold)),
        }
    }
}

/// Value of `--denoise`; [`DenoiseChoice`] without the threshold.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum DenoiseWord {
    /// Smooths pixels that differ from their four neighbours (the paper's filter)
    Paper,
    /// Blurs light within surfaces as far as its noise demands, and keeps edges; for --integrator path
    Edge,
    /// No filter
    Off,
}

/// Parses `--denoise-threshold`, 0 to 4.
fn threshold(word: &str) -> Result<f32, String> {
    let most = RenderOptions::MOST_THRESHOLD;
    word.parse().ok().filter(|x| (0.0..=most).contains(x)).ok_or_else(|| format!("expected a number from 0 to {most}"))
}

/// Parses a finite number above 0.
pub fn positive(word: &str) -> Result<f32, String> {
    let number = word.parse().ok().filter(|x: &f32| x.is_finite() && *x > 0.0);
    number.ok_or_else(|| "expected a number above 0".into())
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use kdray::{frame::Denoise, scene::RenderDefaults};

    use super::*;
    use crate::cli::args::{Args, Command};

    fn denoise(words: &[&str], scene: Denoise) -> Denoise {
        let words = ["kdray", "render", "x.toml"].iter().chain(words);
        match Args::try_parse_from(words).unwrap().command {
            Command::Render(args) => {
                RenderDefaults { denoise: scene, ..RenderDefaults::default() }.with(&args.picture.choices()).denoise
            }
            _ => unreachable!(),
        }
    }

    #[test]
    fn more_triangles_than_pixels_are_not_rasterized() {
        assert_eq!(Primary::suited_to(4800, (80, 60), 1), Primary::Raster);
        assert_eq!(Primary::suited_to(4801, (80, 60), 1), Primary::Trace);
        assert_eq!(Primary::suited_to(4801, (80, 60), 8), Primary::Raster);
        assert_eq!(Primary::suited_to(usize::MAX, (1 << 16, 1 << 16), 8), Primary::Trace);
    }

    #[test]
    fn what_is_left_open_the_scene_fills() {
        let scene = Denoise::Paper { threshold: 1.0 };
        assert_eq!(denoise(&[], scene), scene);
        assert_eq!(denoise(&[], Denoise::Off), Denoise::Off);
        assert_eq!(denoise(&["--denoise", "paper"], scene), scene);
        assert_eq!(denoise(&["--denoise", "off"], scene), Denoise::Off);
        assert_eq!(denoise(&["--denoise-threshold", "0.5"], Denoise::Off), Denoise::Paper { threshold: 0.5 });
        let default = Denoise::Paper { threshold: Denoise::DEFAULT_THRESHOLD };
        assert_eq!(denoise(&["--denoise", "paper"], Denoise::Off), default);
        assert_eq!(denoise(&["--denoise", "edge"], scene), Denoise::Edge);
        assert_eq!(denoise(&[], Denoise::Edge), Denoise::Edge);
    }
}
