//! The materials of a scene file, by which its meshes are named or the materials of its mesh files are changed.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use glam::Vec3;
use toml::Spanned;

use super::{assemble::File, description::CommonSpec};
use crate::scene::{
    formats::material_spec::MaterialSpec,
    model::{Alpha, Material, Scene, error::Checked},
};

/// The materials of a scene file, and what its meshes use them for.
pub(crate) struct NamedMaterials<'a> {
    specs: &'a BTreeMap<String, Spanned<MaterialSpec>>,
    /// Indices into the scene's materials.
    indices: HashMap<String, u32>,
    /// Materials that meshes have.
    worn: HashSet<u32>,
    /// Materials whose terms replace those of a mesh file's material.
    overriding: HashSet<u32>,
    /// Names of the materials of the mesh files whose materials are overridden; `None` if there is no such file.
    of_files: Option<BTreeSet<String>>,
}

impl<'a> NamedMaterials<'a> {
    /// `indices`: where the scene has the material of each name in `specs`.
    pub fn new(specs: &'a BTreeMap<String, Spanned<MaterialSpec>>, indices: HashMap<String, u32>) -> Self {
        Self { specs, indices, worn: HashSet::new(), overriding: HashSet::new(), of_files: None }
    }

    /// Returns the indices of the materials that a mesh names.
    pub fn of_mesh(&mut self, common: &CommonSpec) -> Checked<Vec<u32>> {
        let index = |name: &String| {
            let ix = self.indices.get(name).copied();
            ix.ok_or_else(|| format!("there is no material `{name}` in [materials]"))
        };
        let named = common.material.iter().chain(&common.materials).map(index).collect::<Checked<Vec<u32>>>()?;
        self.worn.extend(&named);
        Ok(named)
    }

    /// Gives the scene's materials from index `first` on the terms that materials of the same names state.
    pub fn override_from(&mut self, scene: &mut Scene, first: usize) -> Checked<()> {
        let (named, of_file) = scene.materials.split_at_mut(first);
        let names = self.of_files.get_or_insert_default();
        for material in of_file {
            names.insert(material.name.clone());
            let Some(&ix) = self.indices.get(&material.name) else { continue };
            let spec = self.specs[&material.name].get_ref();
            let changed = override_terms(material, spec, &named[ix as usize]);
            changed.map_err(|what| format!("override of material `{}`: {what}", material.name))?;
            self.overriding.insert(ix);
        }
        Ok(())
    }

    /// Warns of materials that neither a mesh has nor override another one, if materials are overridden at all. Names
    /// that are alike are suggested.
    pub fn warn_of_unmatched(&self, file: &File) {
        let Some(of_files) = &self.of_files else { return };
        let is_idle = |name: &str| {
            let ix = self.indices[name];
            !self.worn.contains(&ix) && !self.overriding.contains(&ix)
        };
        for (name, spec) in self.specs.iter().filter(|(name, _)| is_idle(name)) {
            let alike = match alike(name, of_files)[..] {
                [] => String::new(),
                ref names => format!(": is {} meant?", names.join(" or ")),
            };
            let what = format!("material `{name}` overrides no material of a mesh file, and no mesh has it{alike}");
            tracing::warn!("{}", file.at(&spec.span(), what));
        }
    }

    /// Removes the materials that only changed others from the scene.
    pub fn remove_idle(&self, scene: &mut Scene) {
        let is_idle = |ix: u32| self.overriding.contains(&ix) && !self.worn.contains(&ix);
        let mut n_kept = 0;
        let new_ix: Vec<u32> = (0..scene.materials.len() as u32)
            .map(|ix| {
                n_kept += u32::from(!is_idle(ix));
                n_kept.saturating_sub(1)
            })
            .collect();
        let mut ix = 0..;
        scene.materials.retain(|_| ix.next().is_some_and(|ix| !is_idle(ix)));
        for material in scene.instances.iter_mut().flat_map(|instance| &mut instance.materials) {
            *material = new_ix[*material as usize];
        }
    }
}

/// Returns the names that a name may be a misspelling of, in quotes: those of the greatest likeness, three at most.
fn alike(name: &str, names: &BTreeSet<String>) -> Vec<String> {
    /// Least likeness (Jaro and Winkler's, 0 to 1) of a name and its misspelling.
    const LEAST_LIKENESS: f64 = 0.8;
    let likeness = |other: &String| strsim::jaro_winkler(&name.to_lowercase(), &other.to_lowercase());
    let mut alike: Vec<(f64, &String)> = names.iter().map(|other| (likeness(other), other)).collect();
    alike.retain(|(likeness, _)| *likeness >= LEAST_LIKENESS);
    alike.sort_by(|a, b| b.0.total_cmp(&a.0));
    alike.truncate(3);
    alike.into_iter().map(|(_, other)| format!("`{other}`")).collect()
}

/// Gives a material the terms that `spec` states. `stated` is the material that `spec` alone describes.
pub(crate) fn override_terms(material: &mut Material, spec: &MaterialSpec, stated: &Material) -> Checked<()> {
    let had_equal_colours = material.ka == material.kd;
    set(&mut material.kd, stated.kd, spec.kd.is_some());
    // Kd is the default of Ka.
    let ka = if spec.ka.is_some() { stated.ka } else { stated.kd };
    set(&mut material.ka, ka, spec.ka.is_some() || spec.kd.is_some() && had_equal_colours);
    set(&mut material.ks, stated.ks, spec.ks.is_some());
    set(&mut material.ke, stated.ke, spec.ke.is_some());
    set(&mut material.tf, stated.tf, spec.tf.is_some());
    set(&mut material.ns, stated.ns, spec.ns.is_some());
    set(&mut material.ni, stated.ni, spec.ni.is_some());
    set(&mut material.lobes, stated.lobes, spec.illum.is_some());
    set(&mut material.is_unlit, stated.is_unlit, spec.unlit.is_some());
    override_opacity(material, spec, stated);
    override_microfacet(material, spec, stated);
    override_coats(material, spec, stated);
    override_maps(material, spec, stated);
    let idle = [("Tf", spec.tf.is_some()), ("Ns", spec.ns.is_some()), ("illum", spec.illum.is_some())];
    match idle.into_iter().find(|(_, is_stated)| *is_stated && material.microfacet.is_some()) {
        Some((term, _)) => Err(format!("it is a microfacet material, which ignores {term}")),
        None => Ok(()),
    }
}

fn set<T>(term: &mut T, value: T, is_stated: bool) {
    if is_stated {
        *term = value;
    }
}

fn override_opacity(material: &mut Material, spec: &MaterialSpec, stated: &Material) {
    let is_stated = spec.d.is_some() || spec.tr.is_some();
    // Another opacity is meant to be seen.
    if is_stated && material.d != stated.d && material.alpha == Alpha::Opaque {
        material.alpha = Alpha::Blend;
    }
    set(&mut material.d, stated.d, is_stated);
    set(&mut material.alpha, stated.alpha, spec.cutoff.is_some());
}

/// Gives a material the microfacet terms that `spec` states. They make a microfacet material of another one.
fn override_microfacet(material: &mut Material, spec: &MaterialSpec, stated: &Material) {
    let Some(stated) = stated.microfacet else { return };
    if material.microfacet.is_none() {
        material.ks = Vec3::ONE;
        material.microfacet = Some(stated);
        return;
    }
    let Some(terms) = &mut material.microfacet else { return };
    set(&mut terms.metallic, stated.metallic, spec.metallic.is_some() || spec.conductor_eta.is_some());
    set(&mut terms.roughness, stated.roughness, spec.roughness.is_some());
    // Light that begins to pass through a surface enters a solid unless it is said to be thin.
    let begins = spec.transmission.is_some() && terms.transmission == 0.0 && stated.transmission > 0.0;
    set(&mut terms.transmission, stated.transmission, spec.transmission.is_some());
    match spec.thin {
        Some(is_thin) => terms.is_solid = !is_thin,
        None if begins => terms.is_solid = true,
        None => {}
    }
    set(&mut terms.attenuation_colour, stated.attenuation_colour, spec.attenuation_color.is_some());
    set(&mut terms.attenuation_distance, stated.attenuation_distance, spec.attenuation_distance.is_some());
    set(&mut terms.conductor, stated.conductor, spec.conductor_eta.is_some());
    set(&mut terms.has_single_scattering, stated.has_single_scattering, spec.single_scattering.is_some());
}

/// Gives a material the clear coat and the sheen that `spec` states.
fn override_coats(material: &mut Material, spec: &MaterialSpec, stated: &Material) {
    set(&mut material.clearcoat.factor, stated.clearcoat.factor, spec.clearcoat.is_some());
    set(&mut material.clearcoat.roughness, stated.clearcoat.roughness, spec.clearcoat_roughness.is_some());
    set(&mut material.sheen.colour, stated.sheen.colour, spec.sheen_color.is_some());
    set(&mut material.sheen.roughness, stated.sheen.roughness, spec.sheen_roughness.is_some());
}

fn override_maps(material: &mut Material, spec: &MaterialSpec, stated: &Material) {
    let (maps, stated) = (&mut material.maps, &stated.maps);
    set(&mut maps.base_colour, stated.base_colour.clone(), spec.map_kd.is_some());
    set(&mut maps.specular, stated.specular.clone(), spec.map_ks.is_some());
    set(&mut maps.emission, stated.emission.clone(), spec.map_ke.is_some());
    set(&mut maps.opacity, stated.opacity.clone(), spec.map_d.is_some());
    set(&mut maps.roughness, stated.roughness.clone(), spec.map_ns.is_some() || spec.map_roughness.is_some());
    set(&mut maps.metallic, stated.metallic.clone(), spec.map_metallic.is_some());
    set(&mut maps.occlusion, stated.occlusion.clone(), spec.map_occlusion.is_some());
    set(&mut maps.normal, stated.normal.clone(), spec.map_normal.is_some());
    set(&mut maps.normal_scale, stated.normal_scale, spec.map_normal.is_some());
}
