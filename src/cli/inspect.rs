//! `kdray inspect`: what a scene holds, and its kd-tree in numbers.

use kdray::{
    accel::kdtree::{KdTree, Statistics},
    engine::choices::{Processor, TreeKind},
    gpu::GpuError,
    layout::{LIGHT_DIRECTIONAL, Light},
    scene::Scene,
    world::FlatScene,
};
use serde::Serialize;

use super::{args::InspectArgs, build, error::CliError, print, print_raw, progress::Progress, table::table};

/// Loads the scene, builds its tree, describes both.
pub fn run(args: &InspectArgs) -> Result<(), CliError> {
    let progress = Progress::new(false, 2);
    let (scene, load_ms) = progress.stage(&format!("loading {}", args.scene.display()), || Scene::load(&args.scene));
    let scene = FlatScene::new(&scene?).map_err(GpuError::from)?;
    let n_triangles = scene.triangles.len();
    let building = format!("building the kd-tree of {n_triangles} triangles");
    let options = TreeKind::Best.options(Processor::Gpu);
    build::check_memory(TreeKind::Best, n_triangles)?;
    let (tree, build_ms) = progress.stage(&building, || KdTree::build(&scene.triangles, &options));
    drop(progress);

    let inspection = Inspection {
        triangles: n_triangles,
        bounds: [tree.cell_min().to_array(), tree.cell_max().to_array()],
        materials: material_uses(&scene),
        lights: scene.lights.iter().map(LightUse::from).collect(),
        tree: tree.statistics(n_triangles, &options),
        load_ms,
        build_ms,
        scene: scene.name,
    };
    if args.json {
        let json = serde_json::to_string_pretty(&inspection).expect("plain structs of numbers and words");
        print_raw(&format!("{json}\n"))
    } else {
        print(&inspection.text())
    }
}

#[derive(Serialize)]
struct Inspection {
    scene: String,
    triangles: usize,
    /// Least and greatest corner, world units.
    bounds: [[f32; 3]; 2],
    materials: Vec<MaterialUse>,
    lights: Vec<LightUse>,
    tree: Statistics,
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
    /// Where a point light is; where a directional one is seen, as a unit vector.
    position: [f32; 3],
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
        text += &self.tree_text();
        text
    }

    fn tree_text(&self) -> String {
        let tree = &self.tree;
        let rows = [
            ["nodes".to_owned(), tree.n_nodes.to_string()],
            ["leaves".to_owned(), tree.n_leaves.to_string()],
            ["empty leaves".to_owned(), tree.n_empty_leaves.to_string()],
            ["slabs".to_owned(), tree.n_slabs.to_string()],
            ["depth".to_owned(), tree.depth.to_string()],
            ["references".to_owned(), tree.n_references.to_string()],
            ["references a triangle".to_owned(), format!("{:.2}", tree.references_per_triangle)],
            ["SAH cost".to_owned(), format!("{:.2}", tree.sah_cost)],
            ["bytes".to_owned(), tree.bytes.to_string()],
            ["build ms".to_owned(), format!("{:.1}", self.build_ms)],
        ];
        table(["kd-tree", ""], &rows)
    }
}

fn vector([x, y, z]: [f32; 3]) -> String {
    format!("({x}, {y}, {z})")
}
