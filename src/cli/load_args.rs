//! Arguments that say what is loaded of a scene's file. All commands that load a scene share them.

use std::path::Path;

use kdray::scene::{LoadOptions, Scene, SceneError};

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
    /// Loads a scene for rays of the user's, which count from the origin of its file.
    pub fn load(&self, path: &Path) -> Result<Scene, SceneError> {
        Scene::load_with(path, &self.options())
    }

    /// Returns the options of loading a scene whose picture has the user's size and look.
    pub fn options_for(&self, picture: &PictureArgs, look: &LookArgs) -> LoadOptions {
        let aspect = picture.size.map(|size| size.width as f32 / size.height as f32);
        LoadOptions { aspect, look: look.look(), ..self.options_of_pictures() }
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
