//! Arguments that say what is loaded of a scene's file. All commands that load a scene share them.

use kdray::{
    engine::LoadRequest,
    scene::{AnimationChoice, AnimationInfo, LoadOptions},
    util::progress::Progress,
};

use super::{look_args::LookArgs, picture_args::PictureArgs};

#[derive(clap::Args)]
pub struct LoadArgs {
    /// Camera of the scene's file to look from: its name, or its index in `kdray inspect`, counted from 0 [default: the
    /// file's default camera]
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// Scene of a glTF file to load: its name, or its index, counted from 0 [default: the file's default scene]
    #[arg(long = "scene", value_name = "NAME|INDEX")]
    pub scene_name: Option<String>,
    /// Show the animations of a glTF or scene file at this time [default: things stand as the file has them at rest]
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub at: Option<f64>,
    /// Show the animations at frame N, which is at N / F seconds (--fps F)
    #[arg(long, value_name = "N", conflicts_with = "at")]
    pub frame: Option<u32>,
    /// Frames a second of --frame and --frames [default: 24]
    #[arg(long, value_name = "F", value_parser = rate)]
    pub fps: Option<f64>,
    /// Animations to show: all together, none, or one by its name or its index in `kdray inspect`, counted from 0
    /// [default: all]
    #[arg(long, value_name = "all|none|NAME|INDEX")]
    pub animation: Option<String>,
    /// Read files that the scene's files name wherever they lie; otherwise only below the folder of the file that names
    /// them
    #[arg(long)]
    pub allow_outside: bool,
}

impl LoadArgs {
    /// Returns the request for a scene into which the user's rays are cast. Coordinates are those of its file.
    pub fn rays(&self) -> LoadRequest {
        LoadRequest { scene: self.options(), ..LoadRequest::rays(0) }
    }

    /// Returns the request for a scene whose picture has the user's options and look. `progress` shows the reading.
    pub fn pictures(&self, picture: &PictureArgs, look: &LookArgs, progress: Progress) -> LoadRequest {
        let scene = LoadOptions { look: look.look(), progress, ..self.options_of_pictures() };
        LoadRequest { scene, ..LoadRequest::pictures(picture.choices()) }
    }

    /// Returns the request for a scene that is examined. It is placed as for pictures, and keeps its own options.
    pub fn scene(&self, progress: Progress) -> LoadRequest {
        LoadRequest { scene: LoadOptions { progress, ..self.options_of_pictures() }, ..LoadRequest::rays(0) }
    }

    /// Returns the options of loading a scene for pictures.
    pub fn options_of_pictures(&self) -> LoadOptions {
        LoadOptions { recentre: true, ..self.options() }
    }

    /// Returns the time of a frame, which may lie between two whole ones, seconds.
    pub fn seconds_of(&self, frame: f64) -> f64 {
        frame / self.frames_a_second()
    }

    /// Returns the time of `--at` or `--frame`, seconds.
    pub fn seconds(&self) -> Option<f64> {
        self.at.or(self.frame.map(|frame| self.seconds_of(frame.into())))
    }

    pub fn frames_a_second(&self) -> f64 {
        self.fps.unwrap_or(24.0)
    }

    /// Whether some of a scene's animations are shown in a film.
    pub fn plays(&self, animations: &[AnimationInfo]) -> bool {
        !animations.is_empty() && self.animation() != AnimationChoice::None
    }

    fn animation(&self) -> AnimationChoice {
        match self.animation.as_deref() {
            None | Some("all") => AnimationChoice::All,
            Some("none") => AnimationChoice::None,
            Some(name) => AnimationChoice::Named(name.to_owned()),
        }
    }

    /// Returns the options of loading.
    pub fn options(&self) -> LoadOptions {
        let &Self { allow_outside, .. } = self;
        LoadOptions {
            scene: self.scene_name.clone(),
            camera: self.camera.clone(),
            allow_outside,
            at: self.seconds(),
            animation: self.animation(),
            ..LoadOptions::default()
        }
    }
}

fn seconds(word: &str) -> Result<f64, String> {
    let seconds = word.parse().ok().filter(|seconds: &f64| seconds.is_finite());
    seconds.ok_or_else(|| "expected a number of seconds, such as 1.5".to_owned())
}

fn rate(word: &str) -> Result<f64, String> {
    let rate = word.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
    rate.ok_or_else(|| "expected a number of frames a second above 0, such as 24 or 29.97".to_owned())
}
