//! What a scene consists of, before it is flattened.

use kdray::{
    scene::{Alpha, AnimationInfo, Camera, Image, Material, Pixels, Projection, Scene, Sky, TermValue},
    world::Textures,
};
use serde::Serialize;
use serde_json::{Map, Value, json};

/// Meshes, images, cameras and the sky of a scene. The materials' details are with the materials.
#[derive(Serialize)]
pub struct Contents {
    pub meshes: Vec<MeshUse>,
    pub images: Vec<ImageUse>,
    pub cameras: Vec<CameraUse>,
    pub animations: Vec<AnimationUse>,
    /// The sky. Its sun is one of the lights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sky: Option<SkyUse>,
    /// The camera that renders the scene.
    pub camera: CameraUse,
}

/// The sky, for `--integrator path`.
#[derive(Serialize)]
pub struct SkyUse {
    /// Unit vector towards the sun.
    pub towards_sun: [f32; 3],
    pub turbidity: f32,
    pub ground_albedo: [f32; 3],
    pub strength: f32,
    /// Whether the sun shines.
    pub sun: bool,
}

impl From<&Sky> for SkyUse {
    fn from(sky: &Sky) -> Self {
        let &Sky { towards_sun, turbidity, ground_albedo, strength, has_sun, .. } = sky;
        let (towards_sun, ground_albedo) = (towards_sun.to_array(), ground_albedo.to_array());
        Self { towards_sun, turbidity, ground_albedo, strength, sun: has_sun }
    }
}

/// A mesh and how often it is placed.
#[derive(Serialize)]
pub struct MeshUse {
    /// Empty if the file names no meshes.
    pub name: String,
    pub triangles: usize,
    pub instances: usize,
    /// Sets of texture coordinates that it has.
    pub uv_sets: usize,
    pub has_colors: bool,
    pub has_tangents: bool,
}

/// A decoded image, and what shows it.
#[derive(Serialize)]
pub struct ImageUse {
    pub name: String,
    pub width: u32,
    pub height: u32,
    /// `8 bit` or `half`.
    pub channels: &'static str,
    /// Bytes of the decoded pixels.
    pub bytes: usize,
    pub used_by: Vec<Shown>,
}

/// The term of a material that shows an image.
#[derive(Serialize)]
pub struct Shown {
    pub material: String,
    pub term: &'static str,
}

/// A camera with its name; the scene's own camera has none.
#[derive(Serialize)]
pub struct CameraUse {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    pub eye: [f32; 3],
    pub target: [f32; 3],
    pub up: [f32; 3],
    /// Degrees; none for an orthographic camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertical_fov: Option<f32>,
    /// World units; none for a perspective camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orthographic_height: Option<f32>,
}

/// An animation. Times are in seconds.
#[derive(Serialize)]
pub struct AnimationUse {
    pub name: String,
    pub begin: f64,
    pub end: f64,
    /// Frames a second, if the keys have even distances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fps: Option<f64>,
    /// Numbers of nodes (or meshes of a scene file) that it moves, and of those whose morph targets it weighs.
    pub moved_nodes: usize,
    pub morphed_nodes: usize,
    /// Number of lights, cameras and materials that it changes.
    #[serde(skip_serializing_if = "is_zero")]
    pub changed: usize,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

impl From<&AnimationInfo> for AnimationUse {
    fn from(info: &AnimationInfo) -> Self {
        let &AnimationInfo { begin, end, fps, n_moved, n_morphed, n_changed, .. } = info;
        let (moved_nodes, morphed_nodes, changed) = (n_moved, n_morphed, n_changed);
        Self { name: info.name.clone(), begin, end, fps, moved_nodes, morphed_nodes, changed }
    }
}

/// What is known of a material beside its triangles.
#[derive(Clone, Serialize)]
pub struct MaterialDetails {
    /// `phong` or `microfacet`.
    pub model: &'static str,
    /// The terms that differ from their defaults, by their keys in scene files.
    pub terms: Map<String, Value>,
    /// How opacity acts: `opaque`, `blend` or `mask`.
    pub opacity: &'static str,
    pub double_sided: bool,
    /// The names of the images of its terms.
    pub maps: Map<String, Value>,
}

/// Bytes that textures take on a device.
#[derive(Serialize)]
pub struct TextureMemory {
    pub texels: usize,
    pub textures: usize,
    pub maps: usize,
    pub uvs: usize,
    pub corners: usize,
    pub total: usize,
}

impl From<&Scene> for Contents {
    fn from(scene: &Scene) -> Self {
        let mut n_instances = vec![0; scene.meshes.len()];
        scene.instances.iter().for_each(|instance| n_instances[instance.mesh_ix] += 1);
        let meshes = scene.meshes.iter().zip(n_instances).map(|(mesh, instances)| MeshUse {
            name: mesh.name.clone(),
            triangles: mesh.faces.len(),
            instances,
            uv_sets: mesh.uvs.iter().filter(|uvs| !uvs.is_empty()).count(),
            has_colors: !mesh.colours.is_empty(),
            has_tangents: !mesh.tangents.is_empty(),
        });
        let cameras = scene.cameras.iter().map(|(name, camera)| CameraUse::new(Some(name.clone()), camera));
        Self {
            meshes: meshes.collect(),
            images: images(scene),
            cameras: cameras.collect(),
            animations: scene.animations.iter().map(AnimationUse::from).collect(),
            sky: scene.sky.as_ref().map(SkyUse::from),
            camera: CameraUse::new(None, &scene.camera),
        }
    }
}

impl CameraUse {
    fn new(name: Option<String>, camera: &Camera) -> Self {
        let Camera { eye, target, up, projection } = *camera;
        let (vertical_fov, orthographic_height) = match projection {
            Projection::Perspective { vertical_fov_degrees } => (Some(vertical_fov_degrees), None),
            Projection::Orthographic { height } => (None, Some(height)),
        };
        let (eye, target, up) = (eye.to_array(), target.to_array(), up.to_array());
        Self { name, eye, target, up, vertical_fov, orthographic_height }
    }
}

fn images(scene: &Scene) -> Vec<ImageUse> {
    let mut images: Vec<ImageUse> = scene.images.iter().map(ImageUse::from).collect();
    for material in &scene.materials {
        for (term, texture) in material.maps.named() {
            let shown = Shown { material: material.name.clone(), term };
            images[texture.image_ix as usize].used_by.push(shown);
        }
    }
    images
}

impl From<&Image> for ImageUse {
    fn from(image: &Image) -> Self {
        let (channels, bytes) = match &image.pixels {
            Pixels::Bytes(pixels) => ("8 bit", size_of_val(&pixels[..])),
            Pixels::Halves(pixels) => ("half", size_of_val(&pixels[..])),
        };
        let &Image { width, height, .. } = image;
        Self { name: image.name.clone(), width, height, channels, bytes, used_by: Vec::new() }
    }
}

impl MaterialDetails {
    pub fn new(material: &Material, scene: &Scene) -> Self {
        let image_of = |image_ix: u32| scene.images.get(image_ix as usize).map_or("", |image| &image.name);
        let maps = material.maps.named().map(|(term, texture)| (term.to_owned(), image_of(texture.image_ix).into()));
        Self {
            model: if material.microfacet.is_some() { "microfacet" } else { "phong" },
            terms: terms(material),
            opacity: match material.alpha {
                Alpha::Opaque => "opaque",
                Alpha::Blend => "blend",
                Alpha::Mask(_) => "mask",
            },
            double_sided: material.is_double_sided,
            maps: maps.collect(),
        }
    }
}

/// Returns the terms that differ from their defaults.
fn terms(material: &Material) -> Map<String, Value> {
    let value = |value: TermValue| match value {
        TermValue::Number(number) => json!(number),
        TermValue::Colour(colour) => json!(colour.to_array()),
        TermValue::Model(illum) => json!(illum),
        TermValue::Flag(flag) => json!(flag),
    };
    let stated = material.terms().into_iter().filter(|term| !term.is_default);
    let mut terms: Map<_, _> = stated.map(|term| (term.key.to_owned(), value(term.value))).collect();
    let (coat, sheen) = (material.clearcoat, material.sheen);
    let coats = [
        ("clearcoat", coat.factor != 0.0, json!(coat.factor)),
        ("clearcoat_roughness", coat.roughness != 0.0, json!(coat.roughness)),
        ("sheen_color", sheen.colour.max_element() != 0.0, json!(sheen.colour.to_array())),
        ("sheen_roughness", sheen.roughness != 0.0, json!(sheen.roughness)),
    ];
    terms.extend(coats.into_iter().filter(|(_, is_there, _)| *is_there).map(|(key, _, value)| (key.to_owned(), value)));
    terms
}

impl From<&Textures> for TextureMemory {
    fn from(textures: &Textures) -> Self {
        let Textures { texels, textures, material_maps, uvs, corners, .. } = textures;
        let [texels, uvs, corners] = [size_of_val(&texels[..]), size_of_val(&uvs[..]), size_of_val(&corners[..])];
        let [textures, maps] = [size_of_val(&textures[..]), size_of_val(&material_maps[..])];
        Self { texels, textures, maps, uvs, corners, total: texels + textures + maps + uvs + corners }
    }
}
