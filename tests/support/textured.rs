//! Scenes with textures, cut-outs and microfacets, made in code.

use std::f32::consts::{PI, TAU};

use glam::{DQuat, DVec3, Vec2, Vec3, Vec4, vec2, vec3};
use kdray::{
    scene::{
        Alpha, Camera, Channel, Image, Instance, Light, Maps, Material, Mesh, Microfacet, Pixels, Projection,
        RenderDefaults, Scene, Texture, Transform,
    },
    world::FlatScene,
};

/// Returns a scene without meshes, seen from z = 4.
pub fn empty() -> Scene {
    Scene {
        name: "textured".to_owned(),
        origin: DVec3::ZERO,
        meshes: Vec::new(),
        instances: Vec::new(),
        materials: Vec::new(),
        images: Vec::new(),
        lights: Vec::new(),
        chosen_light: None,
        camera: Camera {
            eye: vec3(0.0, 0.0, 4.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 45.0 },
        },
        chosen_camera: false,
        cameras: Vec::new(),
        animations: Vec::new(),
        ambient: Vec3::ZERO,
        ground: None,
        background: Vec3::ZERO,
        environment: None,
        sky: None,
        studio: None,
        defaults: RenderDefaults::default(),
    }
}

/// Adds a mesh of one material.
pub fn add(scene: &mut Scene, mesh: Mesh, transform: Transform, material: Material) {
    let (mesh_ix, material_ix) = (scene.meshes.len(), scene.materials.len() as u32);
    scene.meshes.push(mesh);
    scene.materials.push(material);
    scene.instances.push(Instance { mesh_ix, transform, materials: vec![material_ix], ..Instance::default() });
}

/// Adds an image of bytes, whose pixels `colour` gives by column and row. Returns its index.
pub fn add_image(scene: &mut Scene, size: [u32; 2], colour: impl Fn(u32, u32) -> [u8; 4]) -> u32 {
    let [width, height] = size;
    let pixels = Pixels::Bytes((0..width * height).map(|i| colour(i % width, i / width)).collect());
    scene.images.push(Image { name: "image".to_owned(), width, height, pixels, is_linear: false });
    (scene.images.len() - 1) as u32
}

/// A scale, then a move.
pub fn placed(scale: f64, offset: DVec3) -> Transform {
    Transform::new(DVec3::splat(scale), DQuat::IDENTITY, offset).expect("a transform")
}

/// The square from -1 to 1 in the plane z = 0. Its front faces +z, and the image's upper left corner is at (-1, 1).
pub fn square() -> Mesh {
    let positions = vec![vec3(-1.0, -1.0, 0.0), vec3(1.0, -1.0, 0.0), vec3(1.0, 1.0, 0.0), vec3(-1.0, 1.0, 0.0)];
    let faces = vec![[0, 1, 2], [0, 2, 3]];
    let uv = |ix: u32| positions[ix as usize].truncate() * vec2(0.5, -0.5) + 0.5;
    Mesh {
        uvs: [faces.iter().map(|face: &[u32; 3]| face.map(uv)).collect(), Vec::new()],
        normals: vec![[Vec3::Z; 3]; 2],
        tangents: vec![[Vec4::new(1.0, 0.0, 0.0, 1.0); 3]; 2],
        slots: vec![0; 2],
        positions,
        faces,
        ..Mesh::default()
    }
}

/// A sphere of radius 1 with interpolated normals. u goes around the y axis, v from the top to the bottom.
pub fn sphere(n: u32) -> Mesh {
    let (columns, rows) = (2 * n, n);
    let uv = |ix: u32| vec2((ix % (columns + 1)) as f32 / columns as f32, (ix / (columns + 1)) as f32 / rows as f32);
    let point = |uv: Vec2| {
        let (azimuth, polar) = (uv.x * TAU, uv.y * PI);
        vec3(polar.sin() * azimuth.sin(), polar.cos(), polar.sin() * azimuth.cos())
    };
    let tangent = |uv: Vec2| vec3((uv.x * TAU).cos(), 0.0, -(uv.x * TAU).sin()).extend(1.0);
    let quad = |i: u32| {
        let (column, row) = (i % columns, i / columns);
        let a = row * (columns + 1) + column;
        [[a, a + columns + 1, a + columns + 2], [a, a + columns + 2, a + 1]]
    };
    let faces: Vec<[u32; 3]> = (0..columns * rows).flat_map(quad).collect();
    let positions: Vec<Vec3> = (0..(columns + 1) * (rows + 1)).map(|ix| point(uv(ix))).collect();
    Mesh {
        normals: faces.iter().map(|face| face.map(|ix| point(uv(ix)))).collect(),
        uvs: [faces.iter().map(|face| face.map(uv)).collect(), Vec::new()],
        tangents: faces.iter().map(|face| face.map(|ix| tangent(uv(ix)))).collect(),
        slots: vec![0; faces.len()],
        positions,
        faces,
        ..Mesh::default()
    }
}

/// A material that shows its colour without light.
pub fn unlit(kd: Vec3, base_colour: Option<Texture>) -> Material {
    Material { kd, is_unlit: true, alpha: Alpha::Opaque, maps: Maps { base_colour, ..Maps::default() }, ..rough(kd) }
}

/// A rough dielectric.
pub fn rough(kd: Vec3) -> Material {
    Material { kd, ks: Vec3::ONE, microfacet: Some(Microfacet::default()), ..Material::default() }
}

fn metal(kd: Vec3, roughness: f32) -> Material {
    Material { microfacet: Some(Microfacet { metallic: 1.0, roughness, ..Microfacet::default() }), ..rough(kd) }
}

fn see_through(is_solid: bool) -> Material {
    let (transmission, attenuation_colour) = (0.9, vec3(0.6, 0.9, 0.7));
    let microfacet = Microfacet {
        transmission,
        roughness: 0.05,
        is_solid,
        attenuation_colour,
        attenuation_distance: 0.7,
        ..Microfacet::default()
    };
    Material { microfacet: Some(microfacet), ..rough(vec3(0.9, 0.95, 1.0)) }
}

/// Returns a scene with every kind of texture and of microfacet material, under a point, a spot and a directional
/// light.
pub fn every_kind() -> FlatScene {
    FlatScene::new(&scene_of_every_kind()).expect("a scene that fits together")
}

/// Returns what [`every_kind`] flattens.
pub fn scene_of_every_kind() -> Scene {
    let mut scene = empty();
    let checks =
        add_image(
            &mut scene,
            [16, 16],
            |x, y| if (x / 4 + y / 4) % 2 == 0 { [220, 60, 40, 255] } else { [40, 90, 200, 255] },
        );
    let leaves =
        add_image(&mut scene, [32, 32], |x, y| [60, 160, 40, if (x % 8).abs_diff(y % 8) < 3 { 255 } else { 20 }]);
    let fog = add_image(&mut scene, [8, 8], |x, _| [200, 200, 220, (32 * x) as u8]);
    let bumps = add_image(&mut scene, [16, 16], |x, y| [128 + (4 * x) as u8, 190 - (6 * y) as u8, 230, 255]);
    let data = add_image(&mut scene, [4, 4], |x, y| [255 - (40 * x) as u8, (60 * x) as u8, (80 * y) as u8, 255]);
    let floor = Transform::new(
        DVec3::splat(3.0),
        DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
        DVec3::new(0.0, -1.2, 0.0),
    );
    let tiled = Texture::of_image(checks).placed(vec2(3.0, 2.0), vec2(0.2, -0.1));
    let maps = Maps { base_colour: Some(tiled.clone()), ..Maps::default() };
    add(&mut scene, square(), floor.expect("a transform"), Material { maps, ..rough(Vec3::ONE) });
    let maps = Maps {
        base_colour: Some(tiled),
        normal: Some(Texture::of_data(bumps, Channel::Red)),
        normal_scale: 0.8,
        roughness: Some(Texture::of_data(data, Channel::Green)),
        metallic: Some(Texture::of_data(data, Channel::Blue)),
        occlusion: Some(Texture::of_data(data, Channel::Red)),
        occlusion_strength: 0.7,
        emission: Some(Texture::of_image(checks)),
        ..Maps::default()
    };
    let bumpy = Material { ke: vec3(0.02, 0.0, 0.05), maps, ..metal(vec3(1.0, 0.9, 0.8), 1.0) };
    add(&mut scene, sphere(9), placed(0.7, DVec3::new(-1.1, 0.1, 0.0)), bumpy);
    add(&mut scene, sphere(7), placed(0.6, DVec3::new(0.4, -0.5, -0.4)), metal(vec3(0.9, 0.7, 0.3), 0.15));
    add(&mut scene, sphere(8), placed(0.5, DVec3::new(1.4, -0.3, 0.5)), see_through(true));
    add(&mut scene, square(), placed(0.5, DVec3::new(0.5, 0.8, 0.6)), see_through(false));
    let maps = Maps { base_colour: Some(Texture::of_image(leaves)), ..Maps::default() };
    let cutout = Material { alpha: Alpha::Mask(0.5), maps, ..rough(Vec3::ONE) };
    add(&mut scene, square(), placed(0.9, DVec3::new(-0.3, 0.3, 1.2)), cutout);
    let maps = Maps { base_colour: Some(Texture::of_image(fog)), ..Maps::default() };
    add(&mut scene, square(), placed(0.6, DVec3::new(1.0, -0.4, 1.5)), Material { maps, ..rough(Vec3::ONE) });
    let mut painted = sphere(5);
    painted.colours = painted.normals.iter().map(|n| n.map(|n| n.abs().extend(1.0))).collect();
    add(&mut scene, painted, placed(0.3, DVec3::new(-0.2, -0.8, 0.9)), rough(Vec3::ONE));
    let spot = Light::Spot {
        position: vec3(0.0, 3.0, 2.5),
        towards: vec3(0.0, -1.0, -0.8).normalize(),
        intensity: Vec3::splat(9.0),
        inner_cos: 0.95,
        outer_cos: 0.8,
    };
    scene.lights = vec![
        Light::Point { position: vec3(2.0, 2.5, 3.0), intensity: vec3(4.0, 3.5, 3.0) },
        spot,
        Light::Directional { towards: vec3(-0.4, 1.0, 0.3).normalize(), irradiance: Vec3::splat(0.3) },
    ];
    scene.ambient = Vec3::splat(0.25);
    scene.background = vec3(0.2, 0.3, 0.5);
    scene
}
