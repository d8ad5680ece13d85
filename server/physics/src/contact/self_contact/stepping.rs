//! Self-contact's part of a substep.
use super::SelfContact;
use crate::contact::{ContactModel, ContactScratch, ContactState, broad::Skin};
use glam::DVec3;

impl ContactModel {
    /// Presses the walls of a body whose surface's vertices are its nodes, at `x` (m), and adds the forces (N) on nodes.
    /// The body's travel was told to the state before.
    pub(crate) fn press_walls_of_nodes(
        &self,
        x: &[DVec3],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ContactScratch,
    ) {
        let Some(walls) = self.walls() else { return };
        walls.renew(x, scratch.exhaustive, &mut contact.walls, &mut scratch.walls);
        walls.press(x, &contact.walls, forces_n, &mut scratch.walls);
        contact.walls.set_energy_j(scratch.walls.seen().energy_j);
    }

    /// Renews the list of what may meet on a skin, where it is out of date. Returns whether more may be within reach.
    pub(crate) fn list_walls_on_skin(
        &self,
        skin: &impl Skin,
        contact: &mut ContactState,
        scratch: &mut ContactScratch,
    ) -> bool {
        let Some(walls) = self.walls() else { return false };
        let near = &mut contact.walls;
        if near.slack_m > 0.0 || near.is_still_good(|near| skin.moved_m(&near.carriers_then)) {
            return near.wakes_more();
        }
        if near.is_still_good(|near| walls.farthest_m(skin, near)) {
            return near.wakes_more();
        }
        let mut x = std::mem::take(&mut scratch.walls.x);
        walls.vertices().for_each(|vertex| x[vertex as usize] = skin.position_m(vertex));
        walls.query(&x, scratch.exhaustive, near, &mut scratch.walls);
        near.remember_some(&x, walls.vertices());
        scratch.walls.x = x;
        skin.remember(&mut near.carriers_then);
        (0..walls.cluster_count()).for_each(|cluster| skin.remember_walls(cluster, &mut near.clusters_then));
        true
    }

    /// Presses the walls of a skin whose listed vertices are at `x` (m), and adds the forces (N) on vertices.
    pub(crate) fn press_walls_on_skin(
        &self,
        x: &[DVec3],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ContactScratch,
    ) {
        if let Some(walls) = self.walls() {
            walls.press(x, &contact.walls, forces_n, &mut scratch.walls);
            contact.walls.set_energy_j(scratch.walls.seen().energy_j);
        }
    }

    /// Returns the nodes whose positions decide how what is listed meets, some of them several times: those of the pairs,
    /// and of all triangles around them, by which it is known what faces what.
    pub(crate) fn nodes_of_walls<'a>(&'a self, contact: &'a ContactState) -> impl Iterator<Item = u32> + 'a {
        self.walls().into_iter().flat_map(|walls: &SelfContact| {
            let of_pairs = contact
                .walls
                .awake()
                .flat_map(|pair| walls.triangles.nodes[pair.triangle as usize].into_iter().chain([pair.node]));
            let around = of_pairs.flat_map(|node| walls.around.row(node as usize));
            around.flat_map(|&triangle| walls.triangles.nodes[triangle as usize])
        })
    }
}
