//! Save, restore, hash: the whole dynamic state as bytes.
use crate::world::State;

/// FNV-1a over the bits of tick, positions and velocities: equal states give equal hashes on every machine.
pub fn state_hash(state: &State) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut eat = |word: u64| {
        for byte in word.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    };
    eat(state.tick);
    for a in state.x.iter().chain(&state.v) {
        for component in a.to_array() {
            eat(component.to_bits());
        }
    }
    hash
}
