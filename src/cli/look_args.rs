//! Arguments that replace the camera, the lights and the background of a scene.

use clap::ValueEnum;
use glam::{DVec3, Vec3};
use kdray::scene::{LightChoice, Look, MaterialChoice, Preset, Sky, SkyChoice, Up};

use super::{
    or_auto::OrAuto,
    picture_args::{listed, with_words},
};

const UP: &str = "Axis that points up in the picture";
const MATERIAL: &str =
    "Replace all materials, or those called NAME, by a preset such as clay or chrome; may be repeated";

#[derive(clap::Args)]
pub struct LookArgs {
    #[arg(long, value_name = "AXIS", default_value = "auto", hide_default_value = true)]
    #[arg(help = with_words(UP, Some("auto"), &format!("{}, auto", Up::words())), long_help = up_long_help())]
    pub up: OrAuto<Up>,
    /// Point from which the camera looks, in world space; without --target, it looks at the middle of the scene
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point, conflicts_with = "camera")]
    pub eye: Option<DVec3>,
    /// Point that the middle of the picture shows, in world space
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = point)]
    pub target: Option<DVec3>,
    /// Angle between the picture's lower and upper edge, 0.1 to 170 degrees [default: the camera's, else 40, or 60 in
    /// an interior]
    #[arg(long, value_name = "DEGREES", value_parser = fov)]
    pub fov: Option<f32>,
    /// Replace all lights by one directional light that travels along this vector, or by none; ambient light stays
    #[arg(long, value_name = "X,Y,Z|none", allow_hyphen_values = true, value_parser = light)]
    pub light: Option<LightChoice>,
    /// Replace all light by a sky whose sun is ELEVATION degrees above the horizon, for --integrator path. AZIMUTH is
    /// clockwise from -z, or from +y if +z points up [default: over the viewer's left shoulder]. TURBIDITY is the
    /// haziness of the air, 2 to 10 [default: 3]
    #[arg(long, value_name = "ELEVATION[,AZIMUTH[,TURBIDITY]]", allow_hyphen_values = true, value_parser = sky)]
    #[arg(conflicts_with_all = ["light", "background"])]
    pub sky: Option<SkyChoice>,
    /// Faces that the camera does not see: the back faces of materials of glTF files that are not doubleSided, or none
    #[arg(long, value_name = "auto|off", default_value = "auto")]
    pub cull: CullWord,
    #[arg(long = "material", value_name = "[NAME=]PRESET", help = MATERIAL, long_help = material_long_help())]
    pub materials: Vec<MaterialChoice>,
    /// Background, linear red, green and blue, each at least 0 [default: the scene's]
    #[arg(long, value_name = "R,G,B", allow_hyphen_values = true, value_parser = colour)]
    pub background: Option<Vec3>,
}

impl LookArgs {
    /// Returns the user's choices.
    pub fn look(&self) -> Look {
        let &Self { up, eye, target, fov, light, sky, background, cull, ref materials } = self;
        let materials = materials.clone();
        Look {
            up: up.pinned(),
            eye,
            target,
            vertical_fov_degrees: fov,
            light,
            sky,
            background,
            shows_back_faces: cull == CullWord::Off,
            materials,
        }
    }
}

/// Value of `--cull`.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum CullWord {
    /// As the materials of glTF files say
    Auto,
    /// The camera sees both sides of all faces
    Off,
}

/// Returns the help text of `--up` with all words explained.
fn up_long_help() -> String {
    listed(
        UP,
        "auto",
        &format!(
            "{}\n- auto: the camera's; without a camera, z for STL files, for OBJ and PLY files as their \
             comments or a ground below everything tell, and else y",
            Up::descriptions()
        ),
    )
}

/// Returns the help text of `--material` with all words explained.
fn material_long_help() -> String {
    format!("{MATERIAL}. Images of replaced materials are not read.\n\nPresets:\n{}", Preset::descriptions())
}

/// Parses three finite numbers with commas between them, in double precision.
fn point(word: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = word.split(',').map(|number| number.trim().parse().ok()).collect();
    let point = numbers.and_then(|numbers| Some(DVec3::from_array(numbers.try_into().ok()?)));
    let point = point.filter(|point| point.as_vec3().is_finite());
    point.ok_or_else(|| "expected three numbers with commas between them, such as 1,0.5,-2".into())
}

fn vector(word: &str) -> Result<Vec3, String> {
    point(word).map(|point| point.as_vec3())
}

fn fov(word: &str) -> Result<f32, String> {
    let fov = word.parse().ok().filter(|fov| (0.1..=170.0).contains(fov));
    fov.ok_or_else(|| "expected a number of degrees from 0.1 to 170".into())
}

fn light(word: &str) -> Result<LightChoice, String> {
    if word == "none" {
        return Ok(LightChoice::None);
    }
    match vector(word) {
        Ok(Vec3::ZERO) => Err("0,0,0 has no direction".into()),
        Ok(direction) => Ok(LightChoice::Along(direction)),
        Err(error) => Err(format!("{error}, or none")),
    }
}

/// Parses the place of the sun and the turbidity.
fn sky(word: &str) -> Result<SkyChoice, String> {
    let expected =
        "expected an elevation, or up to three numbers with commas between them: elevation, azimuth, turbidity";
    let numbers: Option<Vec<f32>> = word.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.len() <= 3).ok_or(expected)?;
    let (azimuth, turbidity) = (numbers.get(1).copied(), numbers.get(2).copied().unwrap_or(Sky::TURBIDITY));
    // The sky of these numbers is made later, for the axis that points up.
    Sky::new([numbers[0], azimuth.unwrap_or(0.0)], Up::Y)?.with_turbidity(turbidity)?;
    Ok(SkyChoice { elevation: numbers[0], azimuth, turbidity })
}

fn colour(word: &str) -> Result<Vec3, String> {
    vector(word).and_then(|colour| match colour.min_element() >= 0.0 {
        true => Ok(colour),
        false => Err("a colour has no number below 0".into()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_are_three_finite_numbers() {
        assert_eq!(vector("-1,0.5, 2e3"), Ok(Vec3::new(-1.0, 0.5, 2000.0)));
        for word in ["", "1", "1,2", "1,2,3,4", "1,2,x", "1,2,nan", "1,2,inf", "1 2 3", "1,,2"] {
            assert!(vector(word).is_err(), "{word}");
        }
        assert_eq!(light("none"), Ok(LightChoice::None));
        assert_eq!(light("0,-1,0"), Ok(LightChoice::Along(Vec3::NEG_Y)));
        assert!(light("0,0,0").is_err() && light("None").is_err());
        let choice = |azimuth, turbidity| Ok(SkyChoice { elevation: 40.0, azimuth, turbidity });
        assert_eq!(sky("40"), choice(None, 3.0));
        assert_eq!(sky("40,-120"), choice(Some(-120.0), 3.0));
        assert_eq!(sky("40, 120, 6"), choice(Some(120.0), 6.0));
        for word in ["", "x", "40,", "1,2,3,4", "-1", "91", "nan", "40,inf", "40,0,1.9", "40,0,10.1"] {
            assert!(sky(word).is_err(), "{word}");
        }
        assert!(colour("0,0,0").is_ok() && colour("0,-0.1,0").is_err());
        assert!(fov("0.1").is_ok() && fov("171").is_err() && fov("nan").is_err());
    }
}
