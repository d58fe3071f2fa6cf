//! What speaks for a room, where walls surround the middle of a scene. A hollow box, a tray or a crate has such walls,
//! too, and is to be seen from outside. So a room needs two points: each sign is one, a camera or a light inside two,
//! and words in names as many as there are, at most two.

use std::path::Path;

use glam::Vec3;
use hashbrown::HashSet;
use rayon::prelude::*;

use super::few_rays::Hits;
use crate::scene::model::{Instance, Light, Scene};

/// Points that make a room.
const ENOUGH: usize = 2;
/// Least number of the rays from the middle that meet a thing inside.
pub(crate) const LEAST_HITS_OF_THINGS: usize = 3;
/// What has a corner within this share of the half extents from the middle is no wall.
const WITHIN_WALLS: f32 = 0.85;
/// Height and width of rooms, in metres. Files that state no unit often have metres, too.
const HEIGHTS: (f32, f32) = (2.0, 12.0);
const WIDTHS: (f32, f32) = (1.5, 100.0);
/// Words in the names of files, meshes and materials of rooms.
const WORDS: [&str; 21] = [
    "bathroom",
    "bedroom",
    "carpet",
    "ceiling",
    "cornell",
    "corridor",
    "curtain",
    "door",
    "floor",
    "furniture",
    "hallway",
    "indoor",
    "interior",
    "kitchen",
    "livingroom",
    "lobby",
    "office",
    "parquet",
    "room",
    "sofa",
    "window",
];
/// Words of rooms that count only beside others: things have walls, too.
const WEAK_WORDS: [&str; 4] = ["bed", "lamp", "table", "wall"];

/// A box with walls, as rays from its middle see it.
pub(crate) struct Walls<'a> {
    pub scene: &'a Scene,
    /// The scene's file.
    pub path: &'a Path,
    pub bounds: (Vec3, Vec3),
    /// Unit vector.
    pub up: Vec3,
    pub hits: &'a [Hits],
    /// Number of rays that meet something nearer than the walls.
    pub n_things: usize,
    /// Whether rays to the top meet nothing.
    pub is_open_above: bool,
}

impl Walls<'_> {
    /// Returns what speaks for a room, or `None` if that is too little.
    pub fn room(&self) -> Option<String> {
        let mut signs: Vec<String> = Vec::new();
        let mut points = 0;
        let used = self.used_materials();
        let mut add = |is_there: bool, n: usize, sign: &str| {
            if is_there {
                points += n;
                signs.push(sign.to_owned());
            }
        };
        add(self.scene.cameras.iter().any(|(_, camera)| self.contains(camera.eye)), 2, "a camera inside");
        add(self.has_light(), 2, "a light inside");
        add(self.n_things >= LEAST_HITS_OF_THINGS || self.has_things(), 1, "things inside");
        add(self.has_several_materials(), 1, "walls of several materials");
        add(self.has_size_of_room(), 1, "the size of a room");
        let words = self.words(&used);
        let n_of_words = words.len().min(ENOUGH);
        if let Some(word) = words.first() {
            points += n_of_words;
            signs.push(format!("names such as `{word}`"));
        }
        // What is open above shows its inside from outside, too.
        let enough = ENOUGH + usize::from(self.is_open_above);
        (points >= enough).then(|| signs.join(", "))
    }

    fn contains(&self, p: Vec3) -> bool {
        let (min, max) = self.bounds;
        p.cmpgt(min).all() && p.cmplt(max).all()
    }

    /// Returns whether `is_such` holds for some face of the scene. It gets an instance, the index of a face, and the
    /// corners in world space.
    fn any_face(&self, is_such: impl Fn(&Instance, usize, [Vec3; 3]) -> bool + Sync) -> bool {
        self.scene.instances.iter().any(|instance| {
            let mesh = &self.scene.meshes[instance.mesh_ix];
            mesh.faces.par_iter().enumerate().any(|(face_ix, face)| {
                is_such(instance, face_ix, face.map(|ix| instance.transform.point(mesh.positions[ix as usize])))
            })
        })
    }

    /// Returns whether a lamp is inside: a light with a place, or a bright surface that faces the middle.
    fn has_light(&self) -> bool {
        let is_inside = |light: &Light| light.position().is_some_and(|position| self.contains(position));
        let middle = (self.bounds.0 + self.bounds.1) / 2.0;
        let is_bright: Vec<bool> =
            self.scene.materials.iter().map(|material| material.ke.max_element() > 1.0).collect();
        let lights_middle = |instance: &Instance, face_ix: usize, [a, b, c]: [Vec3; 3]| {
            let front = if instance.transform.mirrors() { -1.0 } else { 1.0 };
            is_bright[self.scene.material_ix(instance, face_ix)] && front * (b - a).cross(c - a).dot(middle - a) > 0.0
        };
        self.scene.lights.iter().any(is_inside) || is_bright.contains(&true) && self.any_face(lights_middle)
    }

    /// Returns whether something has a corner far from the walls.
    fn has_things(&self) -> bool {
        let (min, max) = self.bounds;
        let (middle, within) = ((min + max) / 2.0, WITHIN_WALLS * (max - min) / 2.0);
        let is_within = |p: Vec3| (p - middle).abs().cmplt(within).all();
        self.any_face(|_, _, corners| corners.into_iter().any(is_within))
    }

    /// Returns the indices of the materials that faces have.
    fn used_materials(&self) -> HashSet<u32> {
        let slots = self.scene.meshes.par_iter().map(|mesh| mesh.slots.iter().copied().collect());
        let slots: Vec<HashSet<u32>> = slots.collect();
        let of_instance = |Instance { mesh_ix, materials, .. }: &'_ Instance| -> Vec<u32> {
            slots[*mesh_ix].iter().map(|slot| materials[*slot as usize % materials.len()]).collect()
        };
        self.scene.instances.iter().flat_map(of_instance).collect()
    }

    fn has_several_materials(&self) -> bool {
        let material = |hits: &Hits| {
            let hit = hits.last?;
            Some(self.scene.material_ix(&self.scene.instances[hit.instance_ix as usize], hit.face_ix as usize))
        };
        let mut materials = self.hits.iter().filter_map(material);
        let first = materials.next();
        materials.any(|material| Some(material) != first)
    }

    fn has_size_of_room(&self) -> bool {
        let size = self.bounds.1 - self.bounds.0;
        let height = size.dot(self.up.abs());
        let is_wide = |side: f32| (WIDTHS.0..=WIDTHS.1).contains(&side);
        (HEIGHTS.0..=HEIGHTS.1).contains(&height) && size.to_array().into_iter().all(is_wide)
    }

    /// Returns the words of rooms that names contain, each once. Weak ones count beside others.
    fn words(&self, materials: &HashSet<u32>) -> Vec<&'static str> {
        let names = self.scene.meshes.iter().map(|mesh| &mesh.name);
        let names = names.chain(materials.iter().map(|ix| &self.scene.materials[*ix as usize].name));
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let names: Vec<&str> = names.map(String::as_str).chain([&*stem]).collect();
        let is_said = |word: &&&str| names.iter().any(|name| has_word(name, word));
        let mut words: Vec<_> = WORDS.iter().filter(is_said).copied().collect();
        if !words.is_empty() {
            words.extend(WEAK_WORDS.iter().filter(is_said));
        }
        words
    }
}

/// Returns whether a name contains the beginning of a word: at its own beginning, behind what is no letter, or in
/// capitals. A mushroom is no room.
fn has_word(name: &str, word: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    lower.match_indices(word).any(|(at, _)| {
        let is_capital = |c: char| c.is_ascii_uppercase();
        let before = &name[..at];
        !before.ends_with(char::is_alphabetic) || name[at..].starts_with(is_capital) && !before.ends_with(is_capital)
    })
}

#[cfg(test)]
mod tests {
    use super::has_word;

    #[test]
    fn words_begin_where_names_say_so() {
        for name in ["room", "my_room.1", "LivingRoom", "42room", "rooms", "gr\u{fc}ne room"] {
            assert!(has_word(name, "room"), "{name}");
        }
        for name in ["mushroom", "MUSHROOM", "bedroom", "classroom", "roam"] {
            assert!(!has_word(name, "room"), "{name}");
        }
    }
}
