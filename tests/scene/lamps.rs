//! Which light a scene without lights gets if some of its surfaces shine.

use glam::Vec3;
use kdray::{
    frame::Integrator,
    scene::{ChosenLight, Scene},
};

use super::materials::{load_scene, png};

/// A floor whose edge is 10 long, a square on it that stands upright, and a square lamp above its middle.
fn lamp_over_a_floor(half: f32) -> String {
    let square = |name: &str, half: f32, y: f32, first: usize| {
        format!(
            "usemtl {name}\nv {0} {y} {1}\nv {1} {y} {1}\nv {1} {y} {0}\nv {0} {y} {0}\nf {2}/1 {3}/2 {4}/3 {5}/4\n",
            -half,
            half,
            first,
            first + 1,
            first + 2,
            first + 3
        )
    };
    let upright = "v 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nusemtl floor\nf 9 10 11 12\n";
    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    format!("mtllib m.mtl\n{uvs}{}{}{upright}", square("floor", 5.0, 0.0, 1), square("lamp", half, 3.0, 5))
}

/// Loads the lamp over the floor by a scene file of some lines, or as it is if there are none. Returns the notes, too.
fn load(toml: Option<&str>, half: f32, lamp: &str) -> (Scene, Vec<String>) {
    let obj = lamp_over_a_floor(half);
    let mtl = format!("newmtl floor\nKd 0.8\nnewmtl lamp\nKd 0\n{lamp}\n");
    let image = png(|x, _| if x < 2 { [255; 4] } else { [0, 0, 0, 255] });
    let toml = toml.map(|lines| format!("{lines}\n[[mesh]]\nfile = 'm.obj'\n"));
    let scene_file = toml.iter().map(|toml| ("a.toml", toml.as_bytes()));
    let files = [("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("a.png", &image)];
    let (scene, notes) = load_scene(&scene_file.chain(files).collect::<Vec<_>>());
    (scene.unwrap(), notes)
}

/// The lamp is just too weak to count by itself.
#[test]
fn the_integrator_that_a_scene_file_states_decides_whether_lamps_light_it() {
    let of = |toml: Option<&str>, lamp: &str| {
        let (scene, notes) = load(toml, 0.5, lamp);
        let defaults = scene.defaults;
        let is_lit = scene.lights.is_empty() && scene.ambient == Vec3::ZERO;
        assert_eq!(is_lit, scene.chosen_light == Some(ChosenLight::Surfaces), "{toml:?} {lamp}");
        let says_so = notes.iter().any(|note| note.contains("are its only light"));
        assert_eq!(is_lit, says_so, "{notes:?}");
        (is_lit, defaults.integrator, defaults.is_metered)
    };
    let [path, whitted] = ["path", "whitted"].map(|name| format!("[render]\nintegrator = '{name}'"));
    for lamp in ["Ke 8", "Ke 8\nmap_Ke a.png"] {
        assert_eq!(of(Some(&path), lamp), (true, Integrator::Path, true), "{lamp}");
        assert_eq!(of(Some(&format!("{path}\nexposure = 2.0")), lamp), (true, Integrator::Path, false), "{lamp}");
        assert_eq!(of(Some(&whitted), lamp), (false, Integrator::Whitted, false), "{lamp}");
        // With both, the picture would be too bright.
        assert_eq!(of(Some("background = [0, 0, 0]"), lamp), (false, Integrator::Whitted, false), "{lamp}");
        assert_eq!(of(None, lamp), (false, Integrator::Whitted, false), "{lamp}");
    }
    // What is no brighter than paper is no lamp. Paths show its faint glow.
    assert_eq!(of(Some(&path), "Ke 1"), (false, Integrator::Path, false));
}

/// By whitted, a large lamp would leave the scene black, too.
#[test]
fn lamps_light_nothing_if_a_scene_file_states_whitted() {
    let (scene, _) = load(Some("[render]\nintegrator = 'whitted'"), 4.0, "Ke 8");
    assert_eq!((scene.lights.len(), scene.chosen_light), (2, Some(ChosenLight::Outside)));
    let (scene, _) = load(Some(""), 4.0, "Ke 8");
    assert_eq!((scene.lights.len(), scene.chosen_light), (0, Some(ChosenLight::Surfaces)));
    // A scene file whose lamps count has the exposure that it states, and no other light.
    assert_eq!((scene.ambient, scene.background, scene.defaults.is_metered), (Vec3::ZERO, Vec3::ZERO, false));
}

/// Beside lamps, there is some light from everywhere, in the units of the lamps: an eighth of the mean of their light.
#[test]
fn shadows_beside_lamps_are_not_black() {
    let of = |half: f32, lamp: &str| {
        let (scene, _) = load(None, half, lamp);
        assert_eq!((scene.chosen_light, scene.defaults.is_metered), (Some(ChosenLight::Surfaces), true));
        let from_below = scene.ground.unwrap().ambient;
        assert!(from_below.min_element() > 0.0 && from_below.cmplt(scene.ambient).all() && scene.lights.is_empty());
        (scene.ambient.y, scene.background.y)
    };
    let (ambient, background) = of(4.0, "Ke 8");
    // A lamp as large as the sky gives white paper a radiance of 8. This one covers about half of what the floor sees.
    assert!((0.35..0.85).contains(&ambient) && background > ambient, "{ambient} {background}");
    let (of_bright, _) = of(4.0, "Ke 8000");
    assert!((of_bright / ambient - 1000.0).abs() < 1.0, "{of_bright}");
}
