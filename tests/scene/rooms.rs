//! Hollow things are seen from outside, rooms from inside. Each file stands for many that people have.

use std::{fmt::Write, path::Path};

use kdray::scene::{ChosenLight, Scene};

use super::materials::load_scene;

/// A box by its smallest and its largest corner.
type Cuboid = [[f64; 3]; 2];

/// The sides of a box, whose corners are counted by x, then y, then z, counter-clockwise from outside.
const LEFT: [usize; 4] = [0, 4, 6, 2];
const RIGHT: [usize; 4] = [1, 3, 7, 5];
const BOTTOM: [usize; 4] = [0, 1, 5, 4];
const TOP: [usize; 4] = [2, 6, 7, 3];
const BACK: [usize; 4] = [0, 2, 3, 1];
const FRONT: [usize; 4] = [4, 5, 7, 6];
const SIDES: [[usize; 4]; 6] = [LEFT, RIGHT, BOTTOM, TOP, BACK, FRONT];

/// An OBJ file in the making.
#[derive(Default)]
struct Obj {
    text: String,
    n_points: usize,
}

impl Obj {
    /// Adds sides of a box, which face outwards or inwards.
    fn sides(mut self, [min, max]: Cuboid, sides: &[[usize; 4]], is_inward: bool) -> Self {
        for ix in 0..8 {
            let [x, y, z] = std::array::from_fn(|axis| if ix >> axis & 1 == 1 { max[axis] } else { min[axis] });
            writeln!(self.text, "v {x} {y} {z}").unwrap();
        }
        for mut side in sides.iter().copied() {
            if is_inward {
                side.reverse();
            }
            let [a, b, c, d] = side.map(|ix| self.n_points + ix + 1);
            writeln!(self.text, "f {a} {b} {c} {d}").unwrap();
        }
        self.n_points += 8;
        self
    }

    /// Adds a body.
    fn body(self, cuboid: Cuboid) -> Self {
        self.sides(cuboid, &SIDES, false)
    }

    fn bodies(self, cuboids: &[Cuboid]) -> Self {
        cuboids.iter().fold(self, |obj, cuboid| obj.body(*cuboid))
    }

    /// Adds the inner sides of a room without thickness.
    fn room(self, cuboid: Cuboid, open: &[[usize; 4]]) -> Self {
        let sides: Vec<_> = SIDES.into_iter().filter(|side| !open.contains(side)).collect();
        self.sides(cuboid, &sides, true)
    }

    /// Adds walls with a thickness, which are closed or lack a side.
    fn walls(self, [min, max]: Cuboid, thickness: f64, open: &[[usize; 4]]) -> Self {
        let sides: Vec<_> = SIDES.into_iter().filter(|side| !open.contains(side)).collect();
        let inner = [min.map(|x| x + thickness), max.map(|x| x - thickness)];
        self.sides([min, max], &sides, false).sides(inner, &sides, true)
    }

    /// Gives the next faces a material.
    fn material(mut self, name: &str) -> Self {
        writeln!(self.text, "usemtl {name}").unwrap();
        self
    }

    /// Adds a round wall with `n` sides, open above, which faces outwards, inwards, or is there for both.
    fn tube(mut self, (radius, height, n): (f64, f64, usize), is_inward: bool) -> Self {
        for ix in 0..n {
            let (sin, cos) = (ix as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
            writeln!(self.text, "v {0} 0 {1}\nv {0} {height} {1}", radius * cos, radius * sin).unwrap();
        }
        for ix in 0..n {
            let [a, b] = [ix, (ix + 1) % n].map(|ix| self.n_points + 2 * ix + 1);
            let face = if is_inward { [a, b, b + 1, a + 1] } else { [a, a + 1, b + 1, b] };
            writeln!(self.text, "f {}", face.map(|ix| ix.to_string()).join(" ")).unwrap();
        }
        let mut ring: Vec<_> = (0..n).map(|ix| (self.n_points + 2 * ix + 1).to_string()).collect();
        if is_inward {
            ring.reverse();
        }
        writeln!(self.text, "f {}", ring.join(" ")).unwrap();
        self.n_points += 2 * n;
        self
    }
}

fn boxed(w: f64, h: f64, d: f64) -> Cuboid {
    [[0.0; 3], [w, h, d]]
}

/// Loads an OBJ file beside a library of coloured materials.
fn scene_of(name: &str, obj: &Obj) -> Scene {
    let names = ["white", "red", "green", "wood", "steel", "floor", "ceiling", "paint", "glass", "window"];
    let colour = |(ix, name): (usize, &&str)| format!("newmtl {name}\nKd 0.{} 0.5 0.5\n", ix + 1);
    let mtl: String = names.iter().enumerate().map(colour).collect();
    let text = format!("mtllib m.mtl\n{}", obj.text);
    let (scene, _) = load_scene(&[(name, text.as_bytes()), ("m.mtl", mtl.as_bytes())]);
    scene.unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn is_inside(scene: &Scene) -> bool {
    let (min, max) = scene.bounds();
    scene.camera.eye.clamp(min, max) == scene.camera.eye
}

/// What is wrong with files that should be seen from inside or outside.
fn mistaken(files: &[(&'static str, Obj)], expected: ChosenLight) -> Vec<&'static str> {
    let is_wrong = |(name, obj): &&(&str, Obj)| {
        let scene = scene_of(name, obj);
        let is_open_in_front = name.starts_with("open");
        let is_seen = expected == ChosenLight::Outside || is_open_in_front || is_inside(&scene);
        let is_in_front = expected == ChosenLight::Inside && !is_open_in_front || !is_inside(&scene);
        scene.chosen_light != Some(expected) || !is_seen || !is_in_front
    };
    files.iter().filter(is_wrong).map(|(name, _)| *name).collect()
}

fn products() -> Vec<(&'static str, Obj)> {
    let obj = Obj::default;
    let parts = [[[10.0, 2.0, 10.0], [25.0, 20.0, 22.0]], [[40.0, 2.0, 12.0], [60.0, 12.0, 30.0]]];
    let stones = [[[20.0, 1.0, 10.0], [35.0, 12.0, 25.0]], [[60.0, 1.0, 20.0], [80.0, 9.0, 35.0]]];
    let cells: Vec<Cuboid> =
        (0..6).map(|ix| 5.0 + 15.0 * f64::from(ix)).map(|x| [[x, 2.0, 2.0], [x + 9.0, 50.0, 28.0]]).collect();
    let slats: Vec<Cuboid> =
        (0..8).map(f64::from).map(|ix| [[0.0, 0.1 * ix, 0.0], [1.0, 0.1 * ix + 0.02, 0.3]]).collect();
    vec![
        ("tray.obj", obj().walls(boxed(100.0, 25.0, 60.0), 2.0, &[TOP])),
        ("tray_high.obj", obj().walls(boxed(100.0, 40.0, 60.0), 2.0, &[TOP])),
        ("bin.obj", obj().walls(boxed(30.0, 60.0, 30.0), 1.0, &[TOP])),
        ("enclosure.obj", obj().walls(boxed(80.0, 40.0, 60.0), 2.0, &[])),
        (
            "enclosure_with_board.obj",
            obj().walls(boxed(80.0, 40.0, 60.0), 2.0, &[]).body([[10.0, 5.0, 10.0], [70.0, 7.0, 50.0]]),
        ),
        (
            "crate_with_parts.obj",
            obj().material("wood").walls(boxed(80.0, 40.0, 60.0), 2.0, &[TOP]).material("steel").bodies(&parts),
        ),
        ("turned_cube.obj", obj().room(boxed(1.0, 1.0, 1.0), &[])),
        ("turned_large_cube.obj", obj().room(boxed(3.0, 3.0, 3.0), &[])),
        ("turned_cylinder.obj", obj().tube((5.0, 12.0, 24), true)),
        ("pot.obj", obj().tube((10.0, 15.0, 24), false).tube((9.5, 15.0, 24), true)),
        ("mug.obj", obj().tube((0.04, 0.095, 24), false).tube((0.037, 0.095, 24), true)),
        ("drawer.obj", obj().walls(boxed(0.4, 0.15, 0.5), 0.012, &[TOP])),
        ("container.obj", obj().walls(boxed(12.0, 2.6, 2.4), 0.05, &[])),
        (
            "aquarium.obj",
            obj().material("glass").walls(boxed(100.0, 50.0, 45.0), 1.0, &[TOP]).material("steel").bodies(&stones),
        ),
        ("carton.obj", obj().sides(boxed(40.0, 30.0, 30.0), &[LEFT, RIGHT, BOTTOM, BACK, FRONT], false)),
        ("doll_house.obj", obj().material("window").walls(boxed(0.4, 0.5, 0.3), 0.005, &[])),
        ("battery.obj", obj().body(boxed(100.0, 60.0, 30.0)).bodies(&cells)),
        ("shelf.obj", obj().walls(boxed(1.0, 0.8, 0.3), 0.02, &[FRONT]).bodies(&slats)),
        ("safe.obj", obj().material("steel").walls(boxed(0.5, 0.6, 0.5), 0.05, &[])),
        ("hull.obj", obj().walls(boxed(400.0, 80.0, 120.0), 3.0, &[TOP]).bodies(&parts)),
    ]
}

fn rooms() -> Vec<(&'static str, Obj)> {
    let obj = Obj::default;
    let m = boxed(6.0, 2.7, 5.0);
    let furniture = [[[0.1, 0.0, 0.1], [2.0, 2.0, 0.6]], [[4.6, 0.0, 1.0], [5.8, 0.6, 3.0]]];
    let scaled = |factor: f64| furniture.map(|corners: Cuboid| corners.map(|corner| corner.map(|x| factor * x)));
    let columns: Vec<Cuboid> =
        (0..6).map(|ix| 3.0 + 4.0 * f64::from(ix)).map(|x| [[x, 0.0, 3.0], [x + 0.6, 6.0, 3.6]]).collect();
    let blocks = [[[130.0, 0.0, 65.0], [290.0, 165.0, 225.0]], [[265.0, 0.0, 296.0], [425.0, 330.0, 456.0]]];
    let coloured = |cuboid: Cuboid, open: &[[usize; 4]]| {
        let of = |obj: Obj, name: &str, side| {
            if open.contains(&side) { obj } else { obj.material(name).sides(cuboid, &[side], true) }
        };
        let names = ["red", "green", "floor", "ceiling", "paint", "paint"];
        names.into_iter().zip(SIDES).fold(Obj::default(), |obj, (name, side)| of(obj, name, side))
    };
    let plain = |cuboid: Cuboid, open: &[[usize; 4]]| {
        let of = |obj: Obj, name: &str, side| {
            if open.contains(&side) { obj } else { obj.material(name).sides(cuboid, &[side], true) }
        };
        let names = ["red", "green", "white", "white", "white", "white"];
        names.into_iter().zip(SIDES).fold(Obj::default(), |obj, (name, side)| of(obj, name, side))
    };
    vec![
        ("furnished.obj", obj().room(m, &[]).bodies(&furniture)),
        ("furnished_with_walls.obj", obj().walls(m, 0.1, &[]).bodies(&furniture)),
        ("closed_house.obj", obj().body(m).bodies(&furniture)),
        ("living_room.obj", obj().room(m, &[])),
        ("bedroom.obj", obj().walls(m, 0.2, &[])),
        ("open_cornell.obj", plain(boxed(555.0, 555.0, 555.0), &[FRONT]).material("white").bodies(&blocks)),
        ("box_of_goral.obj", plain(boxed(555.0, 555.0, 555.0), &[]).material("white").bodies(&blocks)),
        ("flat_in_mm.obj", coloured(boxed(6000.0, 2700.0, 5000.0), &[]).bodies(&scaled(1000.0))),
        ("flat_in_cm.obj", coloured(boxed(600.0, 270.0, 500.0), &[]).bodies(&scaled(100.0))),
        ("flat_in_feet.obj", coloured(boxed(20.0, 9.0, 16.0), &[]).bodies(&scaled(3.28))),
        ("coloured.obj", coloured(m, &[])),
        ("gallery.obj", plain(m, &[])),
        ("corridor.obj", obj().room(boxed(20.0, 2.5, 2.0), &[])),
        ("hall_with_columns.obj", obj().walls(boxed(30.0, 6.0, 12.0), 0.3, &[]).bodies(&columns)),
        ("warehouse.obj", obj().room(boxed(40.0, 8.0, 20.0), &[]).bodies(&columns)),
        ("lift.obj", plain(boxed(1.6, 2.3, 1.5), &[])),
        ("garage.obj", obj().walls(boxed(6.0, 2.8, 3.5), 0.2, &[]).body([[1.0, 0.2, 1.0], [5.0, 1.3, 2.6]])),
        ("open_stage.obj", coloured(boxed(10.0, 5.0, 8.0), &[FRONT])),
        ("open_office_scene.obj", obj().room(m, &[FRONT]).bodies(&furniture)),
        ("cellar.obj", obj().material("floor").room(m, &[]).bodies(&furniture)),
    ]
}

#[test]
fn hollow_things_are_seen_from_outside_and_rooms_from_inside() {
    let (products, rooms) = (products(), rooms());
    assert_eq!((products.len(), rooms.len()), (20, 20));
    assert_eq!(mistaken(&products, ChosenLight::Outside), Vec::<&str>::new());
    assert_eq!(mistaken(&rooms, ChosenLight::Inside), Vec::<&str>::new());
}

/// Files that Blender 4.5 wrote, of cubes that are scaled, turned inside out, or made solid by a modifier.
#[test]
fn files_of_blender_are_seen_from_their_side() {
    let rooms = ["corridor.glb", "flat.obj", "room_with_light.glb"];
    for name in ["enclosure.obj", "open_crate.glb", "shelf.glb"].iter().chain(&rooms) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scene/blender").join(name);
        let scene = Scene::load(&path).unwrap();
        assert_eq!(is_inside(&scene), rooms.contains(name), "{name}");
    }
}

/// The comparison notices a tray among the rooms.
#[test]
fn a_thing_among_the_rooms_is_noticed() {
    let tray = products().swap_remove(0);
    assert_eq!(mistaken(&[tray], ChosenLight::Inside), ["tray.obj"]);
}

#[test]
fn a_guess_of_a_room_is_told() {
    let told = |obj: Obj| load_scene(&[("m.obj", obj.text.as_bytes())]).1.join("\n");
    let walls = || Obj::default().room(boxed(6.0, 2.7, 5.0), &[]);
    let room = told(walls().body([[1.0, 0.0, 0.5], [2.0, 2.0, 1.5]]));
    assert!(room.contains("is shown as a room: it has things inside, the size of a room"), "{room}");
    assert_eq!(told(walls()), "");
}
