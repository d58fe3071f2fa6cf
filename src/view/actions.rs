//! One-time actions of the user: saving the picture, picking a pixel, placing the camera.

use std::path::Path;

use glam::{DVec3, UVec2, Vec3, uvec2};

use super::{
    gpu_session::GpuSession,
    in_motion::PictureKind,
    input::Action,
    message::{Message, Topic},
    pick::pick,
    session::Session,
    timeline::Timeline,
};
use crate::{
    frame::{Integrator, RenderOptions, View},
    gpu::GpuError,
    output::{self, OutputError},
    render::Displayed,
    scene::{Camera, Projection},
    world::World,
};

/// The reason why a picture was not saved.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    #[error(transparent)]
    Device(#[from] GpuError),
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl Session {
    /// Does an action. Actions on the window and its panels have no effect here. `window` is the window's size in
    /// pixels.
    pub fn act(&mut self, action: Action, gpu: &GpuSession, window: (u32, u32)) {
        match action {
            Action::Save => {
                self.is_save_due = true;
                self.save_if_due(gpu, window);
            }
            Action::PrintCamera => {
                (self.print)(&to_toml(self.controller.camera(), self.loaded.scene().origin));
            }
            Action::FrameScene => self.controller.frame_scene(window.0 as f32 / window.1 as f32),
            Action::GoHome => {
                self.controller.go_home();
                // A note on the axis that points up is no longer true.
                self.message.take_if(|message| !message.is_error);
            }
            Action::ChangeUp => {
                let axis = self.controller.change_up();
                self.message = Some(Message::note(Topic::Settings, &format!("{axis} points up")));
            }
            Action::ChangeMotion if self.settings.options.integrator == Integrator::Path => {
                self.settings.in_motion = self.settings.in_motion.next();
                let note = format!("in motion: {}", self.settings.in_motion);
                self.message = Some(Message::note(Topic::Settings, &note));
            }
            Action::Show(view) if gpu.context.is_none() && view != View::Picture => {
                self.message = Some(Message::note(Topic::Settings, "the CPU engine shows the picture only"));
            }
            Action::Show(view) => self.settings.view = view,
            Action::Pick { x, y } => {
                if let Some(displayed) = gpu.front().displayed() {
                    self.pick((gpu.seen(), gpu.front().options()), displayed, window, (x, y));
                }
            }
            Action::Play => self.loaded.timeline.iter_mut().for_each(Timeline::toggle),
            Action::ChangeMotion | Action::TogglePanel | Action::ToggleKeys | Action::Quit => {}
        }
    }

    /// Saves the displayed picture if a save is due, and if the picture has the window's size and the current camera.
    /// Otherwise the save stays due, while drawing goes on and the window stays responsive.
    pub fn save_if_due(&mut self, gpu: &GpuSession, window: (u32, u32)) {
        let is_whole = |displayed: Displayed| displayed.size == window && displayed.camera == *self.controller.camera();
        let is_at_rest = PictureKind::of(gpu.front().options()) == self.at_rest();
        if is_at_rest && gpu.front().displayed().is_some_and(is_whole) {
            self.save_as_it_is(gpu);
        }
    }

    /// Saves the displayed picture if a save is due, even if the picture is small or unfinished. The file is written on
    /// another thread. The method is called before another camera or view replaces the picture, and before the viewer
    /// ends.
    pub fn save_as_it_is(&mut self, gpu: &GpuSession) {
        if !std::mem::take(&mut self.is_save_due) {
            return;
        }
        match gpu.front().displayed_picture() {
            Ok(Some(picture)) => self.saver.save(&self.loaded.scene().name, picture),
            Ok(None) => {}
            Err(error) => self.show_error(Topic::File, &error.to_string()),
        }
    }

    /// Tells of the pictures that have been written since the last call, and of those that could not be written.
    pub fn report_saves(&mut self) {
        for saved in self.saver.results() {
            match saved {
                Ok(path) => {
                    let note = format!("wrote {}", path.display());
                    (self.print)(&format!("{note}\n"));
                    self.message = Some(Message::note(Topic::File, &note));
                }
                Err(error) => self.show_error(Topic::File, &error.to_string()),
            }
        }
    }

    /// Waits until all pictures have been written, and tells of them.
    pub fn finish_saves(&mut self) {
        self.saver.finish();
        self.report_saves();
    }

    /// Follows the rays of the displayed picture's pixel at a point of the window. `window` and `at` are in pixels.
    fn pick(
        &mut self,
        (world, options): (&World, &RenderOptions),
        displayed: Displayed,
        window: (u32, u32),
        at: (f64, f64),
    ) {
        let (width, height) = displayed.size;
        let pixel = pixel_at(at, window, displayed.size);
        let options = RenderOptions { width, height, ..options.clone() };
        self.picked = Some(pick(world, &options, &displayed.camera, pixel));
    }

    /// Reads the AOVs of the pixel at a point of the window, if the view shows AOVs. While a sample is drawn in
    /// parts, those that were read last stay. `window` and `at` are in pixels.
    ///
    /// # Errors
    /// The copy fails.
    pub fn point_at(&mut self, gpu: &GpuSession, window: (u32, u32), at: (f64, f64)) -> Result<(), GpuError> {
        let RenderOptions { width, height, pixel_aovs, .. } = *gpu.front().options();
        if !pixel_aovs {
            self.pointed = None;
        } else if let Some(aovs) = gpu.front().aovs_at(pixel_at(at, window, (width, height)))? {
            self.pointed = Some(aovs);
        }
        Ok(())
    }
}

/// Returns the pixel of a picture that is shown at a point of the window, or the one nearest to it. All sizes and
/// places are in pixels.
fn pixel_at(at: (f64, f64), window: (u32, u32), picture: (u32, u32)) -> UVec2 {
    let pixel = |at: f64, window: u32, picture: u32| {
        ((at / f64::from(window) * f64::from(picture)).max(0.0) as u32).min(picture - 1)
    };
    uvec2(pixel(at.0, window.0, picture.0), pixel(at.1, window.1, picture.1))
}

/// Writes the renderer's picture in the format of the path's extension, as `kdray render` does.
pub fn save(gpu: &GpuSession, path: &Path) -> Result<(), SaveError> {
    output::write_picture(path, &gpu.renderer.picture()?)?;
    Ok(())
}

/// Returns the camera in the format of scene files. `origin` is the point of the file that is the origin of world
/// space.
fn to_toml(camera: &Camera, origin: DVec3) -> String {
    let vector = |v: Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let point = |p: Vec3| match origin {
        DVec3::ZERO => vector(p),
        _ => format!("{:?}", (p.as_dvec3() + origin).to_array()),
    };
    let Camera { eye, target, up, projection } = *camera;
    let (eye, target, up) = (point(eye), point(target), vector(up));
    let projection = match projection {
        Projection::Perspective { vertical_fov_degrees } => format!("vertical_fov = {vertical_fov_degrees:?}"),
        Projection::Orthographic { height } => format!("orthographic_height = {height:?}"),
    };
    format!("[camera]\neye = {eye}\ntarget = {target}\nup = {up}\n{projection}\n")
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;
    use crate::{
        engine::{
            Builder, LoadRequest,
            choices::{Processor, Request},
        },
        frame::View,
        view::{InMotion, LoadSettings, LoadedScene, Settings, saver::Saver},
    };

    #[test]
    fn a_scene_file_reads_the_printed_camera() {
        let directory = tempfile::TempDir::new().unwrap();
        let path = directory.path().join("view.toml");
        let camera = Camera {
            eye: vec3(3.0e8, -2.5e-7, 1.0),
            target: vec3(0.1, 1.0 / 3.0, -7.0),
            up: Vec3::Z,
            projection: Projection::Perspective { vertical_fov_degrees: 39.5 },
        };
        let mesh = "[[mesh]]\ngenerator = \"plane\"\nsize = [1.0, 1.0]\n";
        for camera in [camera, Camera { projection: Projection::Orthographic { height: 1.0 / 3.0 }, ..camera }] {
            std::fs::write(&path, format!("{}{mesh}", to_toml(&camera, DVec3::ZERO))).unwrap();
            assert_eq!(crate::scene::Scene::load(&path).unwrap().camera, camera);
        }
    }

    /// While a picture from another camera is being drawn, the previous picture is displayed, and clicks pick in it.
    #[test]
    fn a_click_picks_in_the_picture_that_is_seen() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.toml");
        let settings = Settings {
            options: RenderOptions { width: 640, height: 480, ..RenderOptions::default() },
            in_motion: InMotion::default(),
            max_samples: 1,
            budget_ms: 16.0,
            vsync: true,
            view: View::Picture,
            gain: 1.0,
        };
        let builder = Builder::new(Processor::SoftwareDriver, Request::default());
        let settings_of_load = LoadSettings { request: LoadRequest::default(), builder };
        let mut session = Session::new(
            LoadedScene::load(&path, &settings_of_load).unwrap(),
            settings.clone(),
            true,
            (|_| (), Saver::new(|| ())),
        );
        let seen = session.loaded.scene().camera;
        let displayed = Displayed { size: (80, 60), camera: seen };
        session.controller.look(0.5, 0.0);
        let world = session.loaded.built.world.clone();
        session.pick((&world, &settings.options), displayed, (640, 480), (320.0, 300.0));
        let picked = session.picked.expect("rays");
        assert_eq!(picked.pixel, uvec2(40, 37), "a pixel of the small picture that is seen");
        let to_hit = picked.rays[0].hit.as_ref().expect("a hit").point_world - seen.eye;
        let view = (seen.target - seen.eye).normalize();
        let off_middle = to_hit.reject_from(view).length() / seen.height_at(to_hit.dot(view));
        assert!(off_middle < 0.25, "{off_middle} of the picture's height off the middle");
    }
}
