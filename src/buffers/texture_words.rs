//! The array `texture_words`: everything that textures and emitters need, one array after the other
//! (glsl/shared/shading/texture_words.glsl).

use bytemuck::cast_slice;

use crate::{
    layout::{AccelConstants, NO_WORDS},
    world::{Emitters, Textures},
};

const N_ARRAYS: usize = 11;

/// The arrays that are joined, in their order: texels, textures, maps of materials, texture coordinates, corners;
/// emitters, area lights, nodes of the light tree; of the environment's map the alias tables of rows and of texels, and
/// the texels.
pub struct TextureWords<'a> {
    arrays: [&'a [u32]; N_ARRAYS],
    /// The constants of the emitters, without the indices at which their arrays begin.
    emitters: AccelConstants,
}

impl<'a> TextureWords<'a> {
    /// Returns the array of a scene's textures and emitters. It has no words if the scene has neither.
    pub fn new(textures: &'a Textures, emitters: &'a Emitters) -> Self {
        let Textures { texels, textures, material_maps, uvs, corners, .. } = textures;
        let [rows, columns, map] = emitters.environment.as_ref().map_or([&[][..]; 3], |environment| {
            [cast_slice(&environment.rows), cast_slice(&environment.columns), cast_slice(&environment.texels)]
        });
        let arrays = [
            &texels[..],
            cast_slice(textures),
            cast_slice(material_maps),
            cast_slice(uvs),
            cast_slice(corners),
            cast_slice(&emitters.entries),
            cast_slice(&emitters.area_lights),
            cast_slice(&emitters.light_nodes),
            rows,
            columns,
            map,
        ];
        Self { arrays, emitters: emitters.constants() }
    }

    /// Returns the number of words.
    pub fn len(&self) -> usize {
        self.arrays.iter().map(|array| array.len()).sum()
    }

    /// Writes the words from index `first` on.
    pub fn write(&self, first: usize, words: &mut [u32]) {
        let (mut begin, end) = (0, first + words.len());
        for array in self.arrays {
            let (from, to) = (first.max(begin), end.min(begin + array.len()));
            if from < to {
                words[from - first..to - first].copy_from_slice(&array[from - begin..to - begin]);
            }
            begin += array.len();
        }
    }

    /// Writes where the arrays begin into the constants.
    pub fn note_begins(&self, constants: &mut AccelConstants) {
        let mut begin = 0;
        let begins = self.arrays.map(|array| {
            let here = if array.is_empty() { NO_WORDS } else { begin };
            begin += array.len() as u32;
            here
        });
        let [_, textures, maps, uvs, corners, emitters, area_lights, light_nodes, environment, _, _] = begins;
        let of_emitters = &self.emitters;
        *constants = AccelConstants {
            textures_begin: textures,
            material_maps_begin: maps,
            uvs_begin: uvs,
            corners_begin: corners,
            background: of_emitters.background,
            environment_probability: of_emitters.environment_probability,
            ambient: of_emitters.ambient,
            ground_ambient: of_emitters.ground_ambient,
            up_axis: of_emitters.up_axis,
            n_emitters: of_emitters.n_emitters,
            emitters_begin: emitters,
            first_triangle_emitter: of_emitters.first_triangle_emitter,
            n_triangle_emitters: of_emitters.n_triangle_emitters,
            area_lights_begin: area_lights,
            light_nodes_begin: light_nodes,
            n_area_lights: of_emitters.n_area_lights,
            n_suns: of_emitters.n_suns,
            environment_begin: environment,
            environment_width: of_emitters.environment_width,
            environment_height: of_emitters.environment_height,
            environment_turn: of_emitters.environment_turn,
            ..*constants
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_follow_one_another() {
        let arrays: [&[u32]; N_ARRAYS] =
            [&[1, 2, 3], &[], &[4], &[5, 6], &[7], &[8], &[], &[9], &[10, 11], &[12], &[13]];
        let words = TextureWords { arrays, emitters: AccelConstants { n_suns: 2, ..AccelConstants::default() } };
        let mut whole = [0; 13];
        words.write(0, &mut whole);
        assert_eq!((words.len(), whole), (13, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13]));
        for first in 0..13 {
            for n in 0..=13 - first {
                let mut array = vec![0; n];
                words.write(first, &mut array);
                assert_eq!(array, whole[first..first + n]);
            }
        }
        let mut constants = AccelConstants::default();
        words.note_begins(&mut constants);
        let begins = [constants.textures_begin, constants.material_maps_begin, constants.uvs_begin];
        assert_eq!((begins, constants.corners_begin), ([NO_WORDS, 3, 4], 6));
        let begins = [constants.emitters_begin, constants.area_lights_begin, constants.environment_begin];
        assert_eq!((begins, constants.n_suns), ([7, NO_WORDS, 9], 2));
        assert_eq!(constants.light_nodes_begin, 8);
    }
}
