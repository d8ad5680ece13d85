use super::*;
use crate::{
    bodies::BodySpec,
    contact::{Coupling, ToolShape, ToolSpec},
    elements::solid::{Region, Solid},
    material::{Lame, Law, Material, Viscosity},
    mesh::TetMesh,
    settings::Settings,
    world::ModelSpec,
};
use glam::DVec3;

fn model() -> Model {
    let coupling = Coupling::Spring { stiffness_n_per_m: 100.0, damping_n_s_per_m: 1.0, mass_kg: 0.1 };
    Model::build(ModelSpec {
        body: BodySpec::Tet(
            Solid {
                mesh: TetMesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], vec![[0, 1, 2, 3]]).unwrap(),
                regions: vec![Region {
                    name: "all".into(),
                    material: Material {
                        law: Law::StableNeoHookean,
                        lame: Lame::from_young_poisson(1e4, 0.3).unwrap(),
                        viscosity: Viscosity::default(),
                        crushing_pa: 0.0,
                    },
                    density_kg_per_m3: 1e3,
                }],
                tet_region: vec![0],
            }
            .into(),
        ),
        prescribed: Vec::new(),
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![ToolSpec {
            name: "tool".into(),
            shape: ToolShape::capsule(coupling, 0.5, 1.0, DVec3::X),
            radius_m: 0.5,
            coupling,
            friction_coefficient: 0.0,
            start_position_m: DVec3::splat(3.0),
        }],
        settings: Settings::default(),
    })
    .unwrap()
}

fn hash(state: &State) -> u64 {
    let mut chain = Chain::default();
    chain.state(state);
    chain.value()
}

fn flip(number: &mut f64, bit: u32) {
    *number = f64::from_bits(number.to_bits() ^ 1 << bit);
}

#[test]
fn one_flipped_bit_anywhere_changes_the_hash() {
    let model = model();
    let at_rest = State::at_rest(&model);
    let before = hash(&at_rest);
    let flips: [fn(&mut State, u32); 12] = [
        |state, bit| flip(&mut state.mechanical.x[1].x, bit),
        |state, bit| flip(&mut state.mechanical.v[3].z, bit),
        |state, bit| flip(&mut state.mechanical.force_n[0].y, bit),
        |state, bit| flip(&mut state.mechanical.external_n[2].x, bit),
        |state, bit| flip(&mut state.mechanical.tools[0].centre_m.x, bit),
        |state, bit| flip(&mut state.mechanical.tools[0].orientation.w, bit),
        |state, bit| flip(&mut state.mechanical.tools[0].target.angular_velocity_rad_per_s.z, bit),
        |state, bit| flip(&mut state.mechanical.tools[0].device_torque_nm.y, bit),
        |state, bit| flip(&mut state.mechanical.tools[0].friction_heat_j, bit),
        |state, bit| flip(&mut state.mechanical.ledger.dissipated_j, bit),
        |state, bit| flip(&mut state.mechanical.viscous.before_w, bit),
        |state, bit| state.mechanical.tick ^= 1 << bit,
    ];
    for (which, change) in flips.into_iter().enumerate() {
        for bit in 0..64 {
            let mut state = at_rest.clone();
            change(&mut state, bit);
            assert_ne!(hash(&state), before, "bit {bit} of number {which}");
        }
    }
}

/// Zeros of either sign are equal, and yet not the same bits; and two flips do not make up for one another.
#[test]
fn signs_of_zeros_count_each_by_itself() {
    let model = model();
    let mut state = State::at_rest(&model);
    let mut seen = vec![hash(&state)];
    for node in 0..4 {
        state.mechanical.v[node].x = -0.0;
        let hash = hash(&state);
        assert!(!seen.contains(&hash));
        seen.push(hash);
    }
}

#[test]
fn what_came_before_is_in_the_hash() {
    let model = model();
    let state = State::at_rest(&model);
    let of = |before: &[u64]| {
        let mut chain = Chain::default();
        for number in before {
            chain.whole(*number);
        }
        chain.state(&state);
        chain.value()
    };
    assert_ne!(of(&[]), of(&[0]));
    assert_ne!(of(&[0, 1]), of(&[1, 0]));
    let mut again = Chain::default();
    again.whole(7);
    let mut after = Chain::after(again.value());
    after.state(&state);
    assert_eq!(after.value(), of(&[7]));
}
