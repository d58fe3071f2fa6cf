//! `kdray inspect`: the contents of a scene, and the figures of its acceleration structure.

use kdray::{
    accel::Statistics,
    engine::choices::{BuildPolicy, Processor, Request, Workload},
    gpu::GpuError,
    layout::{LIGHT_DIRECTIONAL, Light},
    scene::Scene,
    world::{FlatScene, Mismatch, World},
};
use serde::Serialize;

use super::{args::InspectArgs, build, error::CliError, print, print_raw, progress::Progress, table::table};

/// Loads the scene, builds its structure and describes both.
pub fn run(args: &InspectArgs) -> Result<(), CliError> {
    let progress = Progress::new(false, 2);
    let (scene, load_ms) = progress.stage(&format!("loading {}", args.scene.display()), || Scene::load(&args.scene));
    let scene = FlatScene::new(&scene?).map_err(GpuError::from)?;
    let n_triangles = scene.triangles.len();
    let request = Request { accel: args.accel, build: BuildPolicy::Best, ..Request::default() };
    let accel = request.choose_accel(Processor::Gpu, n_triangles, &Workload::of_rays(0));
    build::check_memory(accel, n_triangles)?;
    let options = accel.options(Processor::Gpu);
    let build = || {
        let world = World::with_accel(scene, &options)?;
        let statistics = world.statistics(); // builds the structure if it is a grid
        Ok::<_, Mismatch>((world, statistics))
    };
    let (built, build_ms) = progress.stage(&build::building(accel, n_triangles), build);
    let (world, statistics) = built.map_err(GpuError::from)?;
    let scene = world.scene();
    drop(progress);

    let inspection = Inspection {
        triangles: n_triangles,
        bounds: world.bounds().map(|corner| corner.to_array()),
        materials: material_uses(scene),
        lights: scene.lights.iter().map(LightUse::from).collect(),
        accel: statistics,
        load_ms,
        build_ms,
        scene: scene.name.clone(),
    };
    if args.json {
        let json = serde_json::to_string_pretty(&inspection).expect("plain structs of numbers and words");
        print_raw(&format!("{json}\n"))
    } else {
        print(&inspection.text())
    }
}

/// The description, as it is printed.
#[derive(Serialize)]
struct Inspection {
    scene: String,
    triangles: usize,
    /// Minimum and maximum corner, world units.
    bounds: [[f32; 3]; 2],
    materials: Vec<MaterialUse>,
    lights: Vec<LightUse>,
    /// Statistics of the acceleration structure, serialized under the key `tree` or `grid`.
    #[serde(flatten)]
    accel: Statistics,
    load_ms: f64,
    build_ms: f64,
}

#[derive(Serialize)]
struct MaterialUse {
    name: String,
    triangles: usize,
}

#[derive(Serialize)]
struct LightUse {
    kind: &'static str,
    /// Position of a point light in world units; unit vector towards a directional light.
    position: [f32; 3],
    /// Radiant intensity of a point light, irradiance of a directional light; linear RGB.
    intensity: [f32; 3],
}

impl From<&Light> for LightUse {
    fn from(light: &Light) -> Self {
        Self {
            kind: if light.kind == LIGHT_DIRECTIONAL { "directional" } else { "point" },
            position: light.position.to_array(),
            intensity: light.intensity.to_array(),
        }
    }
}

fn material_uses(scene: &FlatScene) -> Vec<MaterialUse> {
    let mut uses: Vec<_> =
        scene.material_names.iter().map(|name| MaterialUse { name: name.clone(), triangles: 0 }).collect();
    for &material_ix in &scene.triangle_materials {
        uses[material_ix as usize].triangles += 1;
    }
    uses
}

impl Inspection {
    fn text(&self) -> String {
        let [min, max] = self.bounds.map(vector);
        let mut text = format!("{}: {} triangles, loaded in {:.0} ms\n", self.scene, self.triangles, self.load_ms);
        text += &format!("bounds {min} to {max}\n\n");
        let materials: Vec<_> =
            self.materials.iter().map(|used| [used.name.clone(), used.triangles.to_string()]).collect();
        text += &table(["material", "triangles"], &materials);
        text.push('\n');
        let lights: Vec<_> = (self.lights.iter())
            .map(|light| [light.kind.to_owned(), vector(light.position), vector(light.intensity)])
            .collect();
        text += &table(["light", "position or direction", "intensity"], &lights);
        text.push('\n');
        text += &self.accel_text();
        text
    }

    fn accel_text(&self) -> String {
        let bytes = ("bytes", self.accel.bytes().to_string());
        let build_ms = ("build ms", format!("{:.1}", self.build_ms));
        let rows = self.accel.rows().into_iter().chain([bytes, build_ms]);
        let rows: Vec<_> = rows.map(|(name, value)| [name.to_owned(), value]).collect();
        table([self.accel.kind().name(), ""], &rows)
    }
}

fn vector([x, y, z]: [f32; 3]) -> String {
    format!("({x}, {y}, {z})")
}
