//! The loop's requests.
use super::{Asked, Dialect, EFFECT, HapticMaster, grammar, plane, start};
use palpate_control::ContactPlane;
use std::io::Write as _;

/// Bytes of `set palpate force [-100.00000,-100.00000,-100.00000]`.
const FORCE_BYTES: usize = 47 + EFFECT.len();
/// What writing may put behind a text before it is found to be too long.
pub(super) const MARGIN_BYTES: usize = 256;
/// Every so many requests the emergency stop is asked for, too.
const STOP_ASKED_EVERY: u64 = 20;
/// How.
const STOP: &str = "get emergencybuttonpushed";

/// What takes every force away: a request for each, or one that is refused takes the other with it.
pub(super) fn let_go(with_plane: bool) -> impl Iterator<Item = String> {
    [format!("set {EFFECT} force [0,0,0]")].into_iter().chain(with_plane.then(plane::disable))
}

/// The same as bytes.
pub(super) fn farewell(with_plane: bool) -> Vec<u8> {
    let framed = |text: String| {
        let mut request = Vec::new();
        grammar::frame(text.as_bytes(), &mut request);
        request
    };
    let_go(with_plane).flat_map(framed).collect()
}

impl HapticMaster {
    /// The next request: plane and force, and what the loop asks for.
    pub(super) fn compose(&mut self) {
        self.requests += 1;
        self.asked_periods = 0;
        self.text.clear();
        let mixed = self.dialect == Dialect::Mixed;
        let with_sets = mixed || self.requests.is_multiple_of(2);
        // At the rate of requests that ask for motion, in either dialect.
        let asks = if mixed { self.requests } else { self.requests / 2 };
        let with_stop = asks.is_multiple_of(STOP_ASKED_EVERY).then_some(STOP);
        let gets = with_stop.into_iter().chain(start::MOTION);
        let bytes_of_gets = if mixed { gets.clone().map(|get| 1 + get.len()).sum() } else { 0 };
        let sets = if with_sets { self.compose_sets(grammar::LONGEST_TEXT - bytes_of_gets) } else { 0 };
        let mut commands = sets;
        self.asked = Asked::Set;
        if mixed || !with_sets {
            for command in gets {
                if commands > 0 {
                    self.text.push(b';');
                }
                self.text.extend_from_slice(command.as_bytes());
                commands += 1;
            }
            self.asked = Asked::Motion { with_stop: with_stop.is_some(), sets };
        }
        grammar::frame(&self.text, &mut self.request);
        self.sent = 0;
        self.answer.expect(commands);
    }

    /// Plane and force, in at most so many bytes: how many commands.
    fn compose_sets(&mut self, most: usize) -> usize {
        let force_n = self.force_n.clamp_length_max(self.max_force_n);
        let (count, bias_n) = match &mut self.plane {
            Some(plane) => {
                let wanted = self
                    .wanted
                    .map(|wanted| ContactPlane { max_force_n: wanted.max_force_n.min(self.max_force_n), ..wanted });
                let at = (self.shown.position_m, self.shown.velocity_m_per_s);
                plane.compose(wanted.as_ref(), force_n, at, &mut self.text, most - FORCE_BYTES)
            }
            None => (0, force_n),
        };
        if count > 0 {
            self.text.push(b';');
        }
        // Writing into a Vec cannot fail.
        let _ = write!(self.text, "set {EFFECT} force [{:.5},{:.5},{:.5}]", bias_n.x, bias_n.y, bias_n.z);
        count + 1
    }

    /// Behind the rest of the request on its way, whatever is answered to it.
    pub(super) fn let_go(&mut self) {
        if self.asked != Asked::Nobody && self.sent == self.request.len() {
            self.asked = Asked::Nobody;
            self.sent = 0;
            self.request.clear();
            self.request.extend_from_slice(&self.farewell);
        }
    }
}
