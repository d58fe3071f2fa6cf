//! What the user asks for once.

use std::path::{Path, PathBuf};

use glam::{Vec3, uvec2};

use super::{error::Topic, input::Action, live::Live, pick::pick, session::Session};
use crate::{
    gpu::GpuError,
    output::{self, OutputError},
    scene::Camera,
};

/// Why a picture was not saved.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    #[error(transparent)]
    Device(#[from] GpuError),
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl Session {
    /// Does what the user asks for, but for what is the window's to do. `window`: pixels; `print`: to the terminal.
    pub fn act(&mut self, action: Action, live: &mut Live, window: (u32, u32), print: fn(&str)) {
        match action {
            Action::Save => self.save_next(live, print),
            Action::PrintCamera => print(&to_toml(self.controller.camera())),
            Action::FrameScene => self.controller.frame_scene(window.0 as f32 / window.1 as f32),
            Action::GoHome => self.controller.go_home(),
            Action::Show(view) => self.settings.view = view,
            Action::Pick { x, y } => self.pick(live, window, (x, y)),
            Action::ToggleOverlay | Action::Quit => {}
        }
    }

    /// Saves what is seen under the next free name in the working directory.
    fn save_next(&mut self, live: &mut Live, print: fn(&str)) {
        let path = next_free(&self.loaded.scene.name);
        match self.complete(live).map_err(SaveError::from).and_then(|()| save(live, &path)) {
            Ok(()) => {
                print(&format!("wrote {}\n", path.display()));
                self.settle(Topic::File);
            }
            Err(error) => self.complain(Topic::File, &error.to_string()),
        }
    }

    fn pick(&mut self, live: &Live, window: (u32, u32), (x, y): (f64, f64)) {
        let options = live.renderer.options();
        let pixel = |at: f64, window: u32, picture: u32| {
            ((at / f64::from(window) * f64::from(picture)).max(0.0) as u32).min(picture - 1)
        };
        let pixel = uvec2(pixel(x, window.0, options.width), pixel(y, window.1, options.height));
        let camera = *live.renderer.camera();
        self.picked = Some(pick(&self.loaded.scene, &self.loaded.tree, options, &camera, pixel));
    }
}

/// Writes the renderer's picture as `kdray render` does.
pub fn save(live: &Live, path: &Path) -> Result<(), SaveError> {
    output::write_picture(path, &live.renderer.picture()?)?;
    Ok(())
}

fn next_free(scene_name: &str) -> PathBuf {
    let stem = output::stem_of(scene_name);
    let mut names = (1..).map(|n| PathBuf::from(format!("{stem}-{n:03}.png")));
    names.find(|path| !path.exists()).expect("numbers do not end")
}

/// The camera as a scene file has it.
fn to_toml(camera: &Camera) -> String {
    let vector = |v: Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let Camera { eye, target, up, vertical_fov_degrees } = *camera;
    let (eye, target, up) = (vector(eye), vector(target), vector(up));
    format!("[camera]\neye = {eye}\ntarget = {target}\nup = {up}\nvertical_fov = {vertical_fov_degrees:?}\n")
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn a_scene_file_reads_the_printed_camera() {
        let directory = tempfile::TempDir::new().unwrap();
        let path = directory.path().join("view.toml");
        let camera = Camera {
            eye: vec3(3.0e8, -2.5e-7, 1.0),
            target: vec3(0.1, 1.0 / 3.0, -7.0),
            up: Vec3::Z,
            vertical_fov_degrees: 39.5,
        };
        let mesh = "[[mesh]]\ngenerator = \"plane\"\nsize = [1.0, 1.0]\n";
        std::fs::write(&path, format!("{}{mesh}", to_toml(&camera))).unwrap();
        assert_eq!(crate::scene::Scene::load(&path).unwrap().camera, camera);
    }
}
