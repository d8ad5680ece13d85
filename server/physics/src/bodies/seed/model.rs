//! The model of a seed body, which does not change after it is loaded.
use super::{
    LayerSpec, SeedError, SeedParameters, SeedSpec,
    core::Core,
    layer::{Layer, Walls, enclosed_m3, enclosed_moment_m4},
    links::{LinkMaterial, Links, TriangleMesh},
    radial::Radial,
    region::Region,
    sph::LayerStress,
};
use crate::mesh::Surface;
use glam::DVec3;
use std::collections::BTreeMap;

/// A seed body: a core, and, unless there is the core alone, particles and a skin around it.
#[derive(Debug, Clone)]
pub struct SeedModel {
    parameters: SeedParameters,
    core: Core,
    hull: Option<Hull>,
    surface_rest_m: Vec<DVec3>,
    surface_triangles: Vec<[u32; 3]>,
    /// The core's node of each vertex of the surface; empty where there is a layer.
    vertex_nodes: Vec<u32>,
}

/// The layer and the skin around the core.
#[derive(Debug, Clone)]
pub(super) struct Hull {
    pub(super) layer: Layer,
    pub(super) links: Links,
    /// The region of each triangle of the skin.
    pub(super) regions: Vec<Region>,
    pub(super) stress: LayerStress,
    pub(super) most_awake: usize,
    pub(super) interface_stiffness_n_per_m: f64,
}

impl SeedModel {
    /// Checks the specification and computes everything that the rest state fixes, including every triangle's region.
    ///
    /// # Errors
    /// [`SeedError`], naming what is wrong.
    pub fn build(spec: SeedSpec) -> Result<Self, SeedError> {
        let SeedSpec { core, held_nodes, layer, parameters } = spec;
        parameters.check()?;
        let core = Core::new(&core, &held_nodes, &parameters)?;
        match layer {
            None => Ok(Self::without_layer(parameters, core)),
            Some(layer) => {
                let hull = Hull::new(&core, &layer, &parameters)?;
                let LayerSpec { skin_m, skin_triangles, .. } = layer;
                let (surface_rest_m, surface_triangles) = (skin_m, skin_triangles);
                Ok(Self {
                    parameters,
                    core,
                    hull: Some(hull),
                    surface_rest_m,
                    surface_triangles,
                    vertex_nodes: Vec::new(),
                })
            }
        }
    }

    fn without_layer(parameters: SeedParameters, core: Core) -> Self {
        let Surface { nodes, triangles, .. } = core.boundary().clone();
        let surface_rest_m = nodes.iter().map(|&node| core.rest_m()[node as usize]).collect();
        Self { parameters, core, hull: None, surface_rest_m, surface_triangles: triangles, vertex_nodes: nodes }
    }

    /// Returns the constants.
    pub fn parameters(&self) -> &SeedParameters {
        &self.parameters
    }

    /// Returns the core.
    pub fn core(&self) -> &Core {
        &self.core
    }

    /// Returns the layer of particles, if there is one.
    pub fn layer(&self) -> Option<&Layer> {
        self.hull.as_ref().map(|hull| &hull.layer)
    }

    /// Returns the surface's links; there are none without a layer.
    pub fn links(&self) -> Option<&Links> {
        self.hull.as_ref().map(|hull| &hull.links)
    }

    /// Returns the region of each triangle of the surface; there are none without a layer.
    pub fn regions(&self) -> &[Region] {
        self.hull.as_ref().map_or(&[], |hull| &hull.regions)
    }

    /// Returns the number of particles in the largest region.
    pub fn most_awake(&self) -> usize {
        self.hull.as_ref().map_or(0, |hull| hull.most_awake)
    }

    /// Returns the rest positions (m) of the touchable surface's vertices: those of the skin, or without a layer those
    /// of the core's boundary.
    pub fn surface_rest_m(&self) -> &[DVec3] {
        &self.surface_rest_m
    }

    /// Returns the triangles of the touchable surface, counter-clockwise seen from outside.
    pub fn surface_triangles(&self) -> &[[u32; 3]] {
        &self.surface_triangles
    }

    pub(super) fn hull(&self) -> Option<&Hull> {
        self.hull.as_ref()
    }

    /// Returns the core's node of a vertex, where there is no layer.
    pub(super) fn node_of(&self, vertex: u32) -> usize {
        self.vertex_nodes[vertex as usize] as usize
    }
}

impl Hull {
    fn new(core: &Core, spec: &LayerSpec, parameters: &SeedParameters) -> Result<Self, SeedError> {
        check_closed(spec)?;
        let (core_m, core_triangles) = (core.rest_m(), core.outer_triangles());
        let centre_m = mass_centre_m(core, spec);
        let skin_fan = Radial::new("skin", centre_m, &spec.skin_m, &spec.skin_triangles)?;
        let core_fan = Radial::new("core's outer surface", centre_m, core_m, core_triangles)?;
        let walls = Walls { core_m, core_triangles, core: &core_fan, skin: &skin_fan };
        let layer = Layer::new(spec, &walls, parameters)?;
        let regions = regions(spec, &layer, parameters.first_neighbours)?;
        let stress = LayerStress::new(parameters);
        let modulus_pa = stress.lame().p_wave_modulus_pa();
        let attachments: Vec<_> = spec.skin_m.iter().map(|&vertex| core_fan.attachment(vertex)).collect();
        let links = Links::new(
            TriangleMesh { positions_m: &spec.skin_m, triangles: &spec.skin_triangles },
            &attachments,
            TriangleMesh { positions_m: core_m, triangles: core_triangles },
            &LinkMaterial {
                modulus_pa: modulus_pa * parameters.link_stiffness_ratio,
                damping_ratio: parameters.link_damping_ratio,
                layer_mass_kg: layer.mass_kg * layer.particle_count() as f64,
            },
        );
        Ok(Self {
            most_awake: regions.iter().map(Region::len).max().unwrap_or(0),
            interface_stiffness_n_per_m: parameters.interface_stiffness_ratio * modulus_pa * layer.voxels.spacing_m,
            layer,
            links,
            regions,
            stress,
        })
    }
}

fn check_closed(spec: &LayerSpec) -> Result<(), SeedError> {
    let count = spec.skin_m.len();
    let mut edges: BTreeMap<[u32; 2], [u32; 2]> = BTreeMap::new();
    for triangle in &spec.skin_triangles {
        for side in 0..3 {
            let [a, b] = [triangle[side], triangle[(side + 1) % 3]];
            if a as usize >= count {
                return Err(SeedError::OutOfRange { what: "a triangle of the skin", index: a, count });
            }
            edges.entry([a.min(b), a.max(b)]).or_default()[usize::from(a < b)] += 1;
        }
    }
    let open = edges.values().filter(|sides| **sides != [1, 1]).count();
    if open > 0 || edges.is_empty() {
        return Err(SeedError::Open { edges: open });
    }
    let finite = spec.skin_m.iter().flat_map(DVec3::to_array).find(|a| !a.is_finite());
    match finite {
        Some(value) => Err(SeedError::Parameter { name: "skin_m", value, rule: "all coordinates must be finite" }),
        None => Ok(()),
    }
}

/// Returns the mass centre (m) of core and layer, which have the same density.
fn mass_centre_m(core: &Core, spec: &LayerSpec) -> DVec3 {
    let (core_m, faces) = (core.rest_m(), core.outer_triangles());
    let of_core: f64 = core.mass_kg().iter().sum();
    let core_centre = core.mass_kg().iter().zip(core_m).map(|(m, x)| *x * *m).sum::<DVec3>() / of_core;
    let core_m3 = core.mesh().total_volume_m3();
    let layer_m3 = enclosed_m3(&spec.skin_m, &spec.skin_triangles) - enclosed_m3(core_m, faces);
    let layer_m4 = enclosed_moment_m4(&spec.skin_m, &spec.skin_triangles) - enclosed_moment_m4(core_m, faces);
    (core_centre * core_m3 + layer_m4) / (core_m3 + layer_m3)
}

/// Returns the region of every triangle: the particles under it and, with `first_neighbours`, under all triangles that
/// share a corner with it.
fn regions(spec: &LayerSpec, layer: &Layer, first_neighbours: bool) -> Result<Vec<Region>, SeedError> {
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); spec.skin_m.len()];
    for (triangle, corners) in spec.skin_triangles.iter().enumerate() {
        for &corner in corners {
            around[corner as usize].push(triangle as u32);
        }
    }
    let mut under: Vec<Vec<u32>> = vec![Vec::new(); spec.skin_triangles.len()];
    for (particle, &triangle) in layer.triangle_over.iter().enumerate() {
        under[triangle as usize].push(particle as u32);
    }
    let region = |(triangle, corners): (usize, &[u32; 3])| {
        let mut patch: Vec<u32> = if first_neighbours {
            corners.iter().flat_map(|&corner| around[corner as usize].iter().copied()).collect()
        } else {
            vec![triangle as u32]
        };
        patch.sort_unstable();
        patch.dedup();
        let mut particles: Vec<u32> = patch.iter().flat_map(|&t| under[t as usize].iter().copied()).collect();
        particles.sort_unstable();
        if particles.is_empty() {
            return Err(SeedError::EmptyRegion { triangle });
        }
        let mut vertices: Vec<u32> = patch.iter().flat_map(|&t| spec.skin_triangles[t as usize]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let carried: Vec<(u32, DVec3)> = vertices.iter().map(|&v| (v, spec.skin_m[v as usize])).collect();
        Ok(Region::new(layer, particles, &carried))
    };
    spec.skin_triangles.iter().enumerate().map(region).collect()
}
