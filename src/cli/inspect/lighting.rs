//! The light that has no place, and which light kdray has chosen for a file without lights.

use kdray::scene::{ChosenLight, Scene};
use serde::Serialize;

use super::vector;
use crate::cli::table::table;

/// What lights a scene beside its lights, and where all of its light comes from.
#[derive(Serialize)]
pub struct Lighting {
    /// The choice of kdray: `outside`, `inside` or `surfaces`. It is absent if the file states what lights the scene.
    pub chosen: Option<&'static str>,
    /// Ambient light on surfaces that face up, linear RGB.
    pub ambient: [f32; 3],
    /// Ambient light on surfaces that face down.
    pub ambient_from_below: [f32; 3],
    /// Radiance of rays that leave the scene, unless they see an environment or a sky.
    pub background: [f32; 3],
    /// Unit vector towards the viewer of the studio that metals and glass mirror.
    pub studio: Option<[f32; 3]>,
    /// The integrator of pictures, unless the user states one.
    pub integrator: String,
    /// Factor on radiance, or nothing if it is measured.
    pub exposure: Option<f32>,
}

impl From<&Scene> for Lighting {
    fn from(scene: &Scene) -> Self {
        let from_below = scene.ground.map_or(scene.ambient, |ground| ground.ambient);
        let defaults = &scene.defaults;
        Self {
            chosen: scene.chosen_light.map(|chosen| match chosen {
                ChosenLight::Outside => "outside",
                ChosenLight::Inside => "inside",
                ChosenLight::Surfaces => "surfaces",
            }),
            ambient: scene.ambient.to_array(),
            ambient_from_below: from_below.to_array(),
            background: scene.background.to_array(),
            studio: scene.studio.map(|towards| towards.to_array()),
            integrator: defaults.integrator.to_string(),
            exposure: (!defaults.is_metered).then_some(defaults.exposure),
        }
    }
}

impl Lighting {
    pub fn text(&self) -> String {
        let chosen = match self.chosen {
            Some("outside") => "a main light and a second one from outside, chosen by kdray",
            Some("inside") => "one in the middle and one at the eye, chosen by kdray",
            Some(_) => "none, since surfaces that shine light the scene",
            None => "as the file states",
        };
        let studio = self
            .studio
            .map_or("none".to_owned(), |towards| format!("set up for a viewer in the direction {}", vector(towards)));
        let exposure = self.exposure.map_or("measured".to_owned(), |exposure| exposure.to_string());
        let rows = [
            ["lights", chosen],
            ["ambient light from above", &vector(self.ambient)],
            ["ambient light from below", &vector(self.ambient_from_below)],
            ["background", &vector(self.background)],
            ["studio", &studio],
            ["integrator", &self.integrator],
            ["exposure", &exposure],
        ];
        table(["lighting", ""], &rows.map(|row| row.map(str::to_owned)))
    }
}
