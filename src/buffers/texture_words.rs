//! The array `texture_words`: everything that textures need, one part after the other (glsl/shared/texture_words.glsl).

use bytemuck::cast_slice;

use crate::{
    layout::{AccelConstants, NO_WORDS},
    world::Textures,
};

/// The parts of the array, in their order: texels, textures, maps of materials, texture coordinates, corners.
pub struct TextureWords<'a>([&'a [u32]; 5]);

impl<'a> TextureWords<'a> {
    /// Returns the array of a scene's textures. It has no words if the scene has no textures.
    pub fn new(textures: &'a Textures) -> Self {
        let Textures { texels, textures, material_maps, uvs, corners, .. } = textures;
        Self([texels, cast_slice(textures), cast_slice(material_maps), cast_slice(uvs), cast_slice(corners)])
    }

    /// Returns the number of words.
    pub fn len(&self) -> usize {
        self.0.iter().map(|part| part.len()).sum()
    }

    /// Writes the words from index `first` on.
    pub fn write(&self, first: usize, words: &mut [u32]) {
        let (mut begin, end) = (0, first + words.len());
        for part in self.0 {
            let (from, to) = (first.max(begin), end.min(begin + part.len()));
            if from < to {
                words[from - first..to - first].copy_from_slice(&part[from - begin..to - begin]);
            }
            begin += part.len();
        }
    }

    /// Writes where the parts begin into the constants.
    pub fn note_begins(&self, constants: &mut AccelConstants) {
        let mut begin = 0;
        let begins = self.0.map(|part| {
            let here = if part.is_empty() { NO_WORDS } else { begin };
            begin += part.len() as u32;
            here
        });
        let [_, textures, maps, uvs, corners] = begins;
        constants.textures_begin = textures;
        constants.material_maps_begin = maps;
        constants.uvs_begin = uvs;
        constants.corners_begin = corners;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_follow_one_another() {
        let words = TextureWords([&[1, 2, 3], &[], &[4], &[5, 6], &[7]]);
        let mut whole = [0; 7];
        words.write(0, &mut whole);
        assert_eq!((words.len(), whole), (7, [1, 2, 3, 4, 5, 6, 7]));
        for first in 0..7 {
            for n in 0..=7 - first {
                let mut part = vec![0; n];
                words.write(first, &mut part);
                assert_eq!(part, whole[first..first + n]);
            }
        }
        let mut constants = AccelConstants::default();
        words.note_begins(&mut constants);
        let begins = [constants.textures_begin, constants.material_maps_begin, constants.uvs_begin];
        assert_eq!((begins, constants.corners_begin), ([NO_WORDS, 3, 4], 6));
    }
}
