//! Tests of the layer `motion` against closed forms: a camera that is moved or turned, and a room that moves.

use glam::{DMat3, DVec3, Vec2, Vec3, dvec3, vec2, vec3};
use kdray::{
    cpu::{self, Batching, CpuRenderer, motion_vectors},
    frame::{Crop, RenderOptions},
    layout::PixelAovs,
    scene::{Camera, Projection},
    world::World,
};

use super::studio::{options, world_of};
use crate::support::scenes;

const SIZE: (u32, u32) = (32, 24);

/// The eye is in the middle of a room of half width 5, or of nothing, and looks along -z.
fn view(has_room: bool) -> (World, Camera) {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, if has_room { scenes::room(5.0) } else { Vec::new() }, scenes::diffuse(Vec3::ONE));
    scene.camera.eye = Vec3::ZERO;
    scene.camera.target = vec3(0.0, 0.0, -1.0);
    (world_of(&scene), scene.camera)
}

/// Returns what the pixels of a crop show.
fn aovs(world: &World, crop: Option<Crop>) -> Vec<PixelAovs> {
    let options = RenderOptions { pixel_aovs: true, crop, ..options(SIZE.0, SIZE.1, 1) };
    let mut renderer = CpuRenderer::new(world, &options, Batching::default());
    renderer.draw_sample();
    renderer.pixel_aovs()
}

fn vectors(now: (&World, &Camera), next: (&World, &Camera)) -> Vec<Vec2> {
    let whole = Crop::whole(SIZE.0, SIZE.1);
    motion_vectors([now, next], SIZE, &whole, &aovs(now.0, None)).into_iter().map(Vec2::from).collect()
}

/// The place of each pixel from the picture's middle, in units of half its height: to the right and up.
fn places() -> impl Iterator<Item = Vec2> {
    let half = vec2(SIZE.0 as f32, SIZE.1 as f32) / 2.0;
    let place = move |(x, y): (u32, u32)| (vec2(x as f32 + 0.5, y as f32 + 0.5) - half) * vec2(1.0, -1.0) / half.y;
    (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))).map(place)
}

fn assert_near(found: &[Vec2], expected: impl Iterator<Item = Vec2>) {
    let mut n_pixels = 0;
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.distance(expected) < 1e-4, "{found}, not {expected}");
        n_pixels += 1;
    }
    assert_eq!(n_pixels, 32 * 24);
}

const TAN: f32 = 0.414_213_56; // of 22.5 degrees

/// All that is seen is the back wall, at a distance of 5.
#[test]
fn a_moved_camera_or_wall() {
    let (world, camera) = view(true);
    let step = vec3(0.5, -0.25, 0.0);
    let moved = Camera { eye: camera.eye + step, target: camera.target + step, ..camera };
    let pixels = 12.0 / (5.0 * TAN);
    let by = vec2(step.x, step.y) * pixels;
    assert_near(&vectors((&world, &camera), (&world, &moved)), places().map(|_| -by));
    // A wall that moves instead.
    let mut scene = world.scene().clone();
    scene.triangles.iter_mut().for_each(|t| [&mut t.v0, &mut t.v1, &mut t.v2].into_iter().for_each(|v| *v += step));
    assert_near(&vectors((&world, &camera), (&world_of(&scene), &camera)), places().map(|_| by));
    // Twice as far away, all is half as far from the middle.
    let back = Camera { eye: vec3(0.0, 0.0, 5.0), target: Vec3::ZERO, ..camera };
    assert_near(&vectors((&world, &camera), (&world, &back)), places().map(|place| place * -6.0));
    // Nothing moves, exactly; and nothing is said of what gets behind the camera.
    assert!(vectors((&world, &camera), (&world, &camera)).iter().all(|it| *it == Vec2::ZERO));
    let through = Camera { eye: vec3(0.0, 0.0, -6.0), target: vec3(0.0, 0.0, -7.0), ..camera };
    assert!(vectors((&world, &camera), (&world, &through)).iter().all(|it| *it == Vec2::ZERO));
}

/// Where a camera is turned, the distance does not matter: walls and what is infinitely far away move alike.
#[test]
fn a_turned_camera() {
    let angle = 0.2_f64;
    let turned = |direction: DVec3| DMat3::from_rotation_y(angle) * direction;
    let expected = |place: Vec2| {
        let direction = dvec3(f64::from(place.x * TAN), f64::from(place.y * TAN), -1.0);
        // The direction as the turned camera sees it.
        let seen = DMat3::from_rotation_y(-angle) * direction;
        let now = vec2((seen.x / -seen.z) as f32, (seen.y / -seen.z) as f32) / TAN;
        (now - place) * 12.0
    };
    for has_room in [true, false] {
        let (world, camera) = view(has_room);
        let next = Camera { target: turned(camera.target.as_dvec3()).as_vec3(), ..camera };
        assert_near(&vectors((&world, &camera), (&world, &next)), places().map(expected));
        let away = Camera { target: Vec3::Z, ..camera };
        assert!(vectors((&world, &camera), (&world, &away)).iter().all(|it| *it == Vec2::ZERO));
    }
}

#[test]
fn an_orthographic_camera_and_a_crop() {
    let (world, camera) = view(true);
    let camera = Camera { projection: Projection::Orthographic { height: 4.0 }, ..camera };
    let mut scene = world.scene().clone();
    scene.camera = camera;
    let world = world_of(&scene);
    let step = vec3(0.5, -0.25, -1.0);
    let moved = Camera { eye: camera.eye + step, target: camera.target + step, ..camera };
    let by = vec2(-0.5, 0.25) * 6.0;
    let whole = vectors((&world, &camera), (&world, &moved));
    assert_near(&whole, places().map(|_| by));
    let wider = Camera { projection: Projection::Orthographic { height: 8.0 }, ..camera };
    let whole_wider = vectors((&world, &camera), (&world, &wider));
    assert_near(&whole_wider, places().map(|place| place * -6.0));
    let crop = Crop { x0: 3, y0: 5, x1: 20, y1: 9 };
    let part = cpu::motion_vectors([(&world, &camera), (&world, &wider)], SIZE, &crop, &aovs(&world, Some(crop)));
    let pixels = (crop.y0..crop.y1).flat_map(|y| (crop.x0..crop.x1).map(move |x| (y * SIZE.0 + x) as usize));
    assert!(part.into_iter().map(Vec2::from).eq(pixels.map(|pixel_ix| whole_wider[pixel_ix])));
    // What is infinitely far away stays, since its rays are parallel.
    let (nothing, _) = view(false);
    assert!(vectors((&nothing, &camera), (&nothing, &moved)).iter().all(|it| *it == Vec2::ZERO));
}
