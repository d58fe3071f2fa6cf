//! Tests of the sky and its sun against closed forms and sums over the hemisphere.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};

use super::*;

fn sky(elevation: f32, turbidity: f32) -> Sky {
    Sky::new([elevation, 130.0], Up::Y).unwrap().with_turbidity(turbidity).unwrap()
}

fn assert_near(value: f64, expected: f64, relative: f64) {
    assert!((value - expected).abs() <= relative * expected.abs(), "{value}, not {expected}");
}

fn luminance(colour: DVec3) -> f64 {
    colour.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Returns the irradiance of the sun on a surface that faces it.
fn irradiance_of_sun(sky: &Sky) -> DVec3 {
    let Light::Sun { irradiance, .. } = sky.sun() else { panic!("{:?}", sky.sun()) };
    irradiance.as_dvec3()
}

/// Returns the irradiance of level ground, summed over equal steps of both angles by the formula itself.
fn irradiance_of_formula(sky: &Sky) -> DVec3 {
    const N: usize = 400;
    let mut sum = DVec3::ZERO;
    for (row, column) in (0..N).flat_map(|row| (0..N).map(move |column| (row, column))) {
        let polar = FRAC_PI_2 * (row as f64 + 0.5) / N as f64;
        let azimuth = 2.0 * PI * (column as f64 + 0.5) / N as f64;
        let direction =
            from_compass(DVec3::new(polar.sin() * azimuth.sin(), polar.sin() * azimuth.cos(), polar.cos()), sky.up);
        let solid_angle = polar.sin() * (FRAC_PI_2 / N as f64) * (2.0 * PI / N as f64);
        sum += sky.radiance(direction.as_vec3()).as_dvec3() * (polar.cos() * solid_angle);
    }
    sum
}

/// Returns the irradiance of a surface with this normal, summed over the pixels of the image.
fn irradiance_of_image(environment: &Environment, normal: Vec3) -> DVec3 {
    let [width, height] = environment.size().map(|n| n as usize);
    let of_pixel = |(ix, colour): (usize, &Vec3)| {
        let polar = PI * ((ix / width) as f64 + 0.5) / height as f64;
        let azimuth = 2.0 * PI * (((ix % width) as f64 + 0.5) / width as f64 - 0.5);
        let direction = DVec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos());
        let solid_angle = polar.sin() * (PI / height as f64) * (2.0 * PI / width as f64);
        colour.as_dvec3() * (direction.dot(normal.as_dvec3()).max(0.0) * solid_angle)
    };
    environment.colours().iter().enumerate().map(of_pixel).sum()
}

/// The zenith for a turbidity of 3 and a sun at 60 degrees, by the paper's formulas with numbers in place of letters.
#[test]
fn the_zenith_is_that_of_the_paper() {
    let sun_angle = PI / 6.0;
    let expected = DVec3::new(0.253_434_184, 0.259_792_522, 10.413_086_91);
    assert!((preetham::zenith(3.0, sun_angle) - expected).abs().max_element() < 1e-7);
    let seen = Distribution::new(3.0, sun_angle).at(1.0, sun_angle);
    assert!((seen - expected).abs().max_element() < 1e-7, "{seen}");
    let shown = sky(60.0, 3.0).radiance(Vec3::Y).as_dvec3();
    assert_near(luminance(shown), expected.z * PI / 100.0, 1e-3);
    // The zenith is blue.
    assert!(shown.z > 1.5 * shown.y && shown.y > 1.2 * shown.x, "{shown}");
}

/// The distribution over the sky, for one direction by hand: 40 degrees from the zenith, 25 degrees from the sun.
#[test]
fn directions_are_related_to_the_zenith_as_in_the_paper() {
    let perez = |cosine: f64, angle: f64| {
        let [a, b, c, d, e] = [-0.9269, -0.6387, 5.257, -2.2153, 0.1693];
        (1.0 + a * f64::exp(b / cosine)) * (1.0 + c * f64::exp(d * angle) + e * angle.cos().powi(2))
    };
    let (cosine, angle, sun_angle) = (40_f64.to_radians().cos(), 25_f64.to_radians(), PI / 6.0);
    let expected = 10.413_086_91 * perez(cosine, angle) / perez(1.0, sun_angle);
    assert_near(Distribution::new(3.0, sun_angle).at(cosine, angle).z, expected, 1e-7);
}

#[test]
fn the_image_gives_the_irradiance_of_the_formula() {
    for (elevation, turbidity) in [(90.0, 2.0), (60.0, 3.0), (20.0, 6.0), (0.0, 10.0)] {
        for up in [Up::Y, Up::Z] {
            let sky = Sky { up, ..Sky::new([elevation, 130.0], up).unwrap().with_turbidity(turbidity).unwrap() };
            let (image, formula) = (irradiance_of_image(&sky.environment(), up.vector()), irradiance_of_formula(&sky));
            assert!((image / formula - 1.0).abs().max_element() < 3e-3, "{elevation} {turbidity}: {image} {formula}");
        }
    }
}

/// Below the horizon, the image is the radiance of a Lambertian plain.
#[test]
fn the_ground_reflects_its_share_of_all_light() {
    let albedo = Vec3::new(0.5, 0.2, 0.1);
    let sky = Sky { ground_albedo: albedo, ..sky(50.0, 4.0) };
    let of_sun = irradiance_of_sun(&sky) * 50_f64.to_radians().sin();
    let expected = albedo.as_dvec3() * (irradiance_of_formula(&sky) / PI + of_sun);
    let environment = sky.environment();
    let (lower, last) = (environment.colours()[256 * 1024], environment.colours()[512 * 1024 - 1]);
    assert_eq!(lower, last);
    assert!((last.as_dvec3() / expected - 1.0).abs().max_element() < 1e-3, "{last} {expected}");
    // A hidden sun still shines on the plain.
    assert_eq!(Sky { has_sun: false, ..sky }.environment(), environment);
}

/// White level ground has about the radiance 1 while the sun is high, and is darker the lower the sun is.
#[test]
fn a_high_sun_makes_white_ground_white() {
    let total = |elevation: f32| {
        let sky = sky(elevation, 3.0);
        let of_sun = irradiance_of_sun(&sky) * f64::from(elevation).to_radians().sin();
        luminance(of_sun + irradiance_of_formula(&sky) / PI)
    };
    let totals = [90.0, 60.0, 45.0, 20.0, 5.0, 0.0].map(total);
    assert!(totals[..3].iter().all(|total| (0.8..1.5).contains(total)), "{totals:?}");
    assert!(totals.is_sorted_by(|a, b| a > b), "{totals:?}");
    let twice = Sky { strength: 2.0, ..sky(45.0, 3.0) };
    assert_near(luminance(irradiance_of_sun(&twice)), 2.0 * luminance(irradiance_of_sun(&sky(45.0, 3.0))), 1e-6);
    assert_eq!(twice.radiance(Vec3::X), 2.0 * sky(45.0, 3.0).radiance(Vec3::X));
}

#[test]
fn air_takes_blue_light_from_the_sun() {
    // Outside the air, the sun gives 133 kilolux (Darula et al., 2005); the paper's table has a little less.
    let solid_angle = PI * 0.265_f64.to_radians().sin().powi(2);
    let outside = sun::through(|_, _| 1.0);
    assert_near(outside.y * solid_angle, 133.0, 0.06);
    // It is near the chromaticity of the measured spectrum (ASTM E490), a little yellower than the white of displays.
    let chromaticity = outside / outside.element_sum();
    assert!((chromaticity.x - 0.322).abs() < 0.01 && (chromaticity.y - 0.333).abs() < 0.01, "{chromaticity}");
    let irradiances = [90.0, 45.0, 20.0, 8.0, 2.0].map(|elevation| irradiance_of_sun(&sky(elevation, 3.0)));
    for pair in irradiances.windows(2) {
        assert!(pair[1].x < pair[0].x && pair[1].z / pair[1].x < pair[0].z / pair[0].x, "{irradiances:?}");
    }
    // One mass of air, haze of turbidity 3: 0.686 of the light of 550 nm passes, by the paper's formulas.
    let at_550 = |nm: f64, ozone: f64| if nm == 550.0 { sun::transmittance(3.0, 1.0, nm, ozone) } else { 0.0 };
    let only_550 = |nm: f64, _: f64| f64::from(u8::from(nm == 550.0));
    let expected = (-(0.008735 * 0.55_f64.powf(-4.08) + 0.09238 * 0.55_f64.powf(-1.3) + 0.085 * 0.35)).exp();
    assert_near(sun::through(at_550).y / sun::through(only_550).y, expected, 1e-9);
    // Haze dims the sun.
    assert!(irradiance_of_sun(&sky(45.0, 8.0)).y < irradiance_of_sun(&sky(45.0, 2.0)).y);
}

#[test]
fn the_sun_is_where_it_is_stated() {
    let towards = |place, up| Sky::new(place, up).unwrap().towards_sun;
    for (place, y, z) in [
        ([0.0, 0.0], Vec3::NEG_Z, Vec3::Y),
        ([0.0, 90.0], Vec3::X, Vec3::X),
        ([0.0, 180.0], Vec3::Z, Vec3::NEG_Y),
        ([90.0, 77.0], Vec3::Y, Vec3::Z),
    ] {
        assert!(towards(place, Up::Y).distance(y) < 1e-6 && towards(place, Up::Z).distance(z) < 1e-6, "{place:?}");
    }
    // A sky whose zenith is +z is the other one, turned.
    let [a, b] = [Up::Y, Up::Z].map(|up| Sky::new([30.0, 20.0], up).unwrap());
    let direction = Vec3::new(0.3, 0.5, -0.7).normalize();
    assert!(a.radiance(direction).distance(b.radiance(Vec3::new(direction.x, -direction.z, direction.y))) < 1e-5);
    // The sky is brightest near the sun.
    let near = a.radiance(a.towards_sun);
    assert!(near.y > 2.0 * a.radiance(Vec3::Y).y && near.y > a.radiance(-a.towards_sun).y);
}

#[test]
fn all_skies_are_finite_and_none_is_black() {
    for turbidity in [2.0, 3.0, 6.0, 10.0] {
        for elevation in [0.0, 0.5, 5.0, 30.0, 60.0, 90.0] {
            let sky = sky(elevation, turbidity);
            let environment = sky.environment();
            let greatest = environment.colours().iter().copied().reduce(Vec3::max).unwrap();
            assert!(environment.colours().iter().all(|c| c.is_finite() && c.min_element() >= 0.0));
            let darkest = environment.colours().iter().map(|c| c.max_element()).fold(f32::INFINITY, f32::min);
            assert!(darkest > 1e-3 && greatest.max_element() < 20.0, "{elevation} {turbidity}: {darkest} {greatest}");
            assert!(irradiance_of_sun(&sky).max_element() > 0.0);
        }
    }
}

#[test]
fn places_and_hazes_without_a_model_are_refused() {
    for place in [[-0.1, 0.0], [90.1, 0.0], [f32::NAN, 0.0], [10.0, f32::NAN]] {
        assert!(Sky::new(place, Up::Y).is_err(), "{place:?}");
    }
    let sky = sky(40.0, 3.0);
    for turbidity in [1.9, 10.1, f32::NAN, f32::INFINITY] {
        let error = sky.with_turbidity(turbidity).unwrap_err();
        assert!(error.contains("turbidity") && error.contains("2 to 10"), "{error}");
    }
    let error = above_horizon(Vec3::new(0.0, -0.5, 0.75_f32.sqrt()), Up::Y).unwrap_err();
    assert!(error.contains("30.0 degrees below the horizon"), "{error}");
    assert!(above_horizon(Vec3::NEG_Y, Up::Z).is_ok());
}
