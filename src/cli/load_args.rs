//! Arguments that say what is loaded of a scene's file. All commands that load a scene share them.

use kdray::{engine::LoadRequest, scene::LoadOptions, util::progress::Progress};

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

    /// Returns the options of loading.
    pub fn options(&self) -> LoadOptions {
        let &Self { allow_outside, .. } = self;
        LoadOptions {
            scene: self.scene_name.clone(),
            camera: self.camera.clone(),
            allow_outside,
            ..LoadOptions::default()
        }
    }
}
