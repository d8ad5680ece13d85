//! Two regions whose Young's moduli differ by up to 1:10⁴, pulled and let go.
use super::{Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use glam::DVec3;
use miette::Result;
use palpate_physics::{LoadSpec, Region, material::Law};

pub(super) const CRITERION: &str = "two regions 1:1 to 1:10^4: energy never above initial + work";

const SECOND_ORDER: &str = "leapfrog holds K + U - dt^2/8 f_i.f/m, not K + U: the energy of the moment exceeds the work by that term, O(dt^2), \
                            with no drift";

const SOFT_PA: f64 = 1e3;
const RATIOS: [f64; 5] = [1.0, 10.0, 100.0, 1e3, 1e4];

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let ticks = options.pick(20, 200, 2_000);
    let mut outcome = Outcome::passing();
    for ratio in RATIOS {
        let mut rig = layered(options, ratio)?;
        let mut drive = Drive::still(&rig.model);
        let (mut work_j, mut excess_j, mut unexplained_j) = (0.0_f64, f64::NEG_INFINITY, f64::NEG_INFINITY);
        for tick in 0..ticks {
            drive.load_factors[0] = if tick % 40 < 10 { 1.0 } else { 0.0 };
            let report = rig.tick(&drive);
            outcome.demand(report.quarantined.is_none(), || format!("ratio {ratio}: quarantined at tick {tick}"));
            let energies = rig.energies();
            work_j = work_j.max(energies.external_work_j.abs());
            let over_j = energies.held_j() - energies.external_work_j;
            excess_j = excess_j.max(over_j);
            unexplained_j = unexplained_j.max(over_j - rig.leapfrog_excess_j());
        }
        let name = |what: &str| format!("{what}, ratio 1:{ratio:.0}");
        outcome.push(Measured::value(name("substeps"), f64::from(rig.model.substeps()), "1/tick"));
        let stated = Measured::bounded(name("energy above work / work"), excess_j / work_j, "1", 1e-12);
        outcome.push(stated.known_to_exceed(SECOND_ORDER, 0.03));
        outcome.push(Measured::bounded(name("of it not leapfrog's own"), unexplained_j / work_j, "1", 1e-6));
    }
    Ok(outcome)
}

/// A block, held below, its lower half soft and its upper half stiff, with a dead traction along x on its top.
fn layered(options: &Options, ratio: f64) -> Result<Rig> {
    let mesh = meshes::block(4)?;
    let soft = material(Law::StableNeoHookean, SOFT_PA, 0.4)?;
    let stiff = material(Law::StableNeoHookean, SOFT_PA * ratio, 0.4)?;
    let centre_z = |tet: usize| mesh.corners_m(tet).iter().map(|p| p.z).sum::<f64>() / 4.0;
    let tet_region = (0..mesh.tets().len()).map(|tet| u16::from(centre_z(tet) > -0.01)).collect();
    let floor = meshes::nodes_where(&mesh, |p| p.z < -0.0199);
    let triangles = meshes::triangles_where(&mesh, |p| p.z > -1e-9)?;
    let mut spec = rig::body(options, mesh, soft);
    let solid = rig::solid_mut(&mut spec);
    solid.regions.push(Region { name: "stiff".into(), material: stiff, density_kg_per_m3: 1000.0 });
    solid.tet_region = tet_region;
    spec.prescribed = vec![rig::hold("floor", floor)];
    // About 1 % of shear in the soft half: small enough that the trapezoid of the internal forces is their work to 1e-6.
    spec.loads = vec![LoadSpec::Traction { triangles, traction_pa: DVec3::X * 1e-3 * SOFT_PA }];
    Rig::new(spec)
}
