//! Snapshots, which are the whole dynamic state as bytes, and a hash of the state.
//!
//! Layout (little-endian): `PLPS`, version (u32), fingerprint of the body (u64), checksum of what follows (u64), state
//! (postcard). A state goes back only into the body it came from: same mesh, materials, loads, tools and settings.
use crate::{
    hash::{Fnv, OFFSET, fnv},
    world::{Model, State},
};
use std::fmt::Write;
use thiserror::Error;

const MAGIC: [u8; 4] = *b"PLPS";
const HEADER: usize = 24;
/// Version of the layout; snapshots of other versions are refused.
pub const VERSION: u32 = 20;

/// Why bytes are not a state of a body.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SnapshotError {
    /// The bytes are no snapshot.
    #[error("these {bytes} bytes are no snapshot: they do not begin as one")]
    NoSnapshot {
        /// Their number.
        bytes: usize,
    },
    /// The snapshot has another version.
    #[error("the snapshot has version {found}, this program reads version {VERSION}")]
    Version {
        /// Version that was found.
        found: u32,
    },
    /// The snapshot belongs to another body.
    #[error(
        "the snapshot belongs to another body: mesh, materials, loads, tools or settings differ from the loaded scene's"
    )]
    OtherBody,
    /// The snapshot is damaged.
    #[error("the snapshot is damaged: {what}")]
    Damaged {
        /// What is wrong.
        what: &'static str,
    },
}

/// Returns a state as bytes.
pub fn save(model: &Model, state: &State) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + state.mechanical.x.len() * 96);
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    bytes.extend_from_slice(&fingerprint(model).to_le_bytes());
    bytes.extend_from_slice(&[0; 8]);
    // Writing to memory cannot fail for a type without unknown lengths; an empty body would be refused by `restore`.
    let mut bytes = postcard::to_extend(state, bytes).unwrap_or_default();
    if bytes.len() > HEADER {
        let checksum = fnv(OFFSET, bytes[HEADER..].iter().copied());
        bytes[16..HEADER].copy_from_slice(&checksum.to_le_bytes());
    }
    bytes
}

/// Returns the state that [`save`] wrote.
///
/// # Errors
/// [`SnapshotError`]. Nothing else happens, whatever the bytes are.
pub fn restore(model: &Model, bytes: &[u8]) -> Result<State, SnapshotError> {
    let (header, body) = bytes.split_at_checked(HEADER).ok_or(SnapshotError::NoSnapshot { bytes: bytes.len() })?;
    if header[..4] != MAGIC {
        return Err(SnapshotError::NoSnapshot { bytes: bytes.len() });
    }
    let found = word(header, 4) as u32;
    if found != VERSION {
        return Err(SnapshotError::Version { found });
    }
    if word(header, 8) != fingerprint(model) {
        return Err(SnapshotError::OtherBody);
    }
    if word(header, 16) != fnv(OFFSET, body.iter().copied()) {
        return Err(SnapshotError::Damaged { what: "its checksum is wrong" });
    }
    let (mut state, rest): (State, &[u8]) = postcard::take_from_bytes(body)
        .map_err(|_| SnapshotError::Damaged { what: "it ends early or has other fields" })?;
    if !rest.is_empty() {
        return Err(SnapshotError::Damaged { what: "bytes follow its end" });
    }
    check(model, &state)?;
    let contact = &mut state.mechanical.contact;
    *contact = model.contact().adopt(contact).ok_or(SnapshotError::Damaged { what: "its contact does not fit" })?;
    Ok(state)
}

fn check(model: &Model, state: &State) -> Result<(), SnapshotError> {
    let State { mechanical, body: own, pace, sleep, quarantine: _ } = state;
    let (environment, body) = (model.environment(), model.body());
    let positions = own.positions(body);
    let fits = own.fits(body, environment, mechanical)
        && mechanical.fits(environment, positions)
        && pace.fits(environment, model.is_judged(), positions)
        && sleep.fits(model);
    if !fits {
        return Err(SnapshotError::OtherBody);
    }
    let vectors = pace.vectors().chain(&sleep.held_m).chain(own.vectors());
    if mechanical.is_finite() && vectors.into_iter().all(|a| a.is_finite()) {
        Ok(())
    } else {
        Err(SnapshotError::Damaged { what: "a number in it is not finite" })
    }
}

fn word(header: &[u8], at: usize) -> u64 {
    let mut bytes = [0; 8];
    let end = (at + 8).min(HEADER);
    bytes[..end - at].copy_from_slice(&header[at..end]);
    u64::from_le_bytes(bytes)
}

/// Returns a hash of what makes a body and its environment: the rest positions, and everything else that it was built
/// from, as it prints.
fn fingerprint(model: &Model) -> u64 {
    let positions =
        model.rest_positions_m().iter().flat_map(glam::DVec3::to_array).flat_map(|c| c.to_bits().to_le_bytes());
    let mut hash = Fnv(fnv(OFFSET, positions));
    model.body().fingerprint_into(&mut hash);
    let around = (model.prescribed(), model.loads(), model.gravity_m_per_s2(), model.tools(), model.settings());
    // A float prints as the shortest text that reads back to its bits. Writing to the hash cannot fail.
    let _ = write!(hash, "{around:?}");
    hash.0
}

/// Returns the FNV-1a hash of the bits of tick, positions and velocities, including a seed body's particles. Equal
/// states give equal hashes on every machine.
pub fn state_hash(state: &State) -> u64 {
    let State { mechanical, body, .. } = state;
    let components = mechanical.x.iter().chain(&mechanical.v).chain(body.vectors()).flat_map(glam::DVec3::to_array);
    let bytes = mechanical.tick.to_le_bytes().into_iter();
    fnv(OFFSET, bytes.chain(components.flat_map(|c| c.to_bits().to_le_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bodies::BodySpec,
        elements::solid::{Region, Solid},
        mesh::TetMesh,
        settings::Settings,
        world::ModelSpec,
    };
    use glam::DVec3;

    fn model(scale_m: f64) -> Model {
        let p = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| p * scale_m).to_vec();
        let material = crate::material::Material {
            law: crate::material::Law::StableNeoHookean,
            lame: crate::material::Lame::from_young_poisson(1e4, 0.3).unwrap(),
            viscosity: crate::material::Viscosity::default(),
            crushing_pa: 0.0,
        };
        Model::build(ModelSpec {
            body: BodySpec::Tet(
                Solid {
                    mesh: TetMesh::new(p, vec![[0, 1, 2, 3]]).unwrap(),
                    regions: vec![Region { name: "all".into(), material, density_kg_per_m3: 1e3 }],
                    tet_region: vec![0],
                }
                .into(),
            ),
            prescribed: Vec::new(),
            loads: Vec::new(),
            gravity_m_per_s2: DVec3::ZERO,
            tools: Vec::new(),
            settings: Settings::default(),
        })
        .unwrap()
    }

    fn moved(model: &Model) -> State {
        let mut state = State::at_rest(model);
        state.mechanical.tick = 41;
        state.mechanical.x[1] += DVec3::new(0.1, -0.2, 1.0 / 3.0);
        state.mechanical.v[2] = DVec3::new(-1e-300, 2.0, 0.0);
        state
    }

    #[test]
    fn a_state_survives_with_its_bits() {
        let model = model(1.0);
        let state = moved(&model);
        let back = restore(&model, &save(&model, &state)).unwrap();
        assert_eq!(back, state);
        assert_eq!(state_hash(&back), state_hash(&state));
    }

    #[test]
    fn one_wrong_bit_anywhere_is_refused() {
        let model = model(1.0);
        let good = save(&model, &moved(&model));
        for at in 0..good.len() {
            let mut bad = good.clone();
            bad[at] ^= 0x10;
            assert!(restore(&model, &bad).is_err(), "byte {at}");
            assert!(restore(&model, &good[..at]).is_err(), "cut at {at}");
        }
    }

    #[test]
    fn another_body_is_refused_by_name() {
        let (one, other) = (model(1.0), model(2.0));
        assert_eq!(restore(&other, &save(&one, &moved(&one))), Err(SnapshotError::OtherBody));
    }

    #[test]
    fn a_state_that_is_not_finite_is_refused() {
        let model = model(1.0);
        let mut state = moved(&model);
        state.mechanical.x[0].x = f64::NAN;
        assert!(matches!(restore(&model, &save(&model, &state)), Err(SnapshotError::Damaged { .. })));
    }
}
