//! The contact's plane on the arm: a `flatplane` effect, which the arm's own controller renders, and the rest of the force beside it.
//!
//! What the arm has is known to the digit that was sent, so the bias force is what the commanded force leaves when that plane, and no other, has given its part where the arm is:
//! plane and bias are the commanded force in every request, also while a new plane is only half told. Between two requests the plane goes on with the hand and the bias stays.
//!
//! What only hardware can tell: whether the commands of a request come into force together; `dampfactor` ([`DampFactor`]); and that a force within [`LARGEST`] counts the plane's damping, too.
use glam::DVec3;
use palpate_control::ContactPlane;
use std::io::Write as _;

/// Name of the plane on the arm: short, for a request has 255 bytes.
pub const PLANE: &str = "contact";
/// Where a plane is. No public manual says it of shapes; a public program sets it so for its flat planes.
pub const POSITION: &str = "pos";
/// The largest force of a shape outward. One public client calls it `no_outward_forcemax`, others this.
pub const LARGEST: &str = "outward_forcemax";
/// The least that is sent for it (N): public clients have it 0 at first, which may mean none and may mean no bound.
const LEAST_FORCE_N: f64 = 1e-3;
/// A plane farther away (m) or stiffer (N/m) than this is none for an arm on a table.
const FARTHEST_M: f64 = 10.0;
const STIFFEST_N_PER_M: f64 = 1e6;
/// A plane may be enabled when its stiffness and damping are right to this share: while a ramp goes up they change with every request.
const ENABLED_WITHIN: f64 = 0.1;
/// The largest force is raised when it is too low by this share of the limit: it need not follow every tremor.
const RAISED_BY: f64 = 0.01;

/// What the arm means by a `dampfactor`. Public sources do not say; public programs set 0.7 on springs of 100 N/m, as one does a share of critical damping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DampFactor {
    /// Share of critical damping: `B = 2 ζ √(k m)`.
    Ratio {
        /// The arm's mass m (kg).
        inertia_kg: f64,
    },
    /// N s/m.
    Coefficient,
}

impl DampFactor {
    /// Its value for a damping (N s/m) beside a stiffness (N/m).
    pub fn of(self, damping_n_s_per_m: f64, stiffness_n_per_m: f64) -> f64 {
        match self {
            Self::Ratio { inertia_kg } => damping_n_s_per_m / (2.0 * (stiffness_n_per_m * inertia_kg).sqrt()),
            Self::Coefficient => damping_n_s_per_m,
        }
    }

    /// The damping (N s/m) that it is.
    pub fn damping_n_s_per_m(self, value: f64, stiffness_n_per_m: f64) -> f64 {
        match self {
            Self::Ratio { inertia_kg } => 2.0 * value * (stiffness_n_per_m * inertia_kg).sqrt(),
            Self::Coefficient => value,
        }
    }
}

/// How planes are told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneSettings {
    /// What a damping is to the arm.
    pub damp_factor: DampFactor,
}

/// The plane, without force, and nothing of it that we do not ask for: it does not pull, and along the surface the bias force acts.
pub(super) fn commands_to_create() -> Vec<String> {
    let set = |what: &str| format!("set {PLANE} {what}");
    let mut commands = vec![format!("create flatplane {PLANE}"), disable()];
    commands.extend(["no_pull true", "friction 0", "tang_damping 0", "stiffness 0", "dampfactor 0"].map(set));
    commands.push(set(&format!("{LARGEST} {LEAST_FORCE_N}")));
    commands
}

/// Takes the plane's force away.
pub(super) fn disable() -> String {
    format!("set {PLANE} disable")
}

/// What the arm has, as it was told.
#[derive(Debug)]
pub struct Plane {
    damp_factor: DampFactor,
    point_m: DVec3,
    normal: DVec3,
    stiffness_n_per_m: f64,
    dampfactor: f64,
    largest_n: f64,
    enabled: bool,
    /// Which part of a new plane is told first when not all of it fits into a request.
    first: usize,
}

/// Where the arm is (m), and how it moves (m/s).
pub type At = (DVec3, DVec3);

/// Commands behind one another, up to a number of bytes.
struct Commands<'a> {
    text: &'a mut Vec<u8>,
    most: usize,
    count: usize,
}

impl Commands<'_> {
    /// Adds some, if they fit: whether they did.
    fn add(&mut self, count: usize, write: impl FnOnce(&mut Vec<u8>)) -> bool {
        let before = self.text.len();
        if before > 0 {
            self.text.push(b';');
        }
        write(self.text);
        let fits = self.text.len() <= self.most;
        if fits {
            self.count += count;
        } else {
            self.text.truncate(before);
        }
        fits
    }
}

impl Plane {
    /// As it was created.
    pub fn new(settings: PlaneSettings) -> Self {
        Self {
            damp_factor: settings.damp_factor,
            point_m: DVec3::ZERO,
            normal: DVec3::Z,
            stiffness_n_per_m: 0.0,
            dampfactor: 0.0,
            largest_n: LEAST_FORCE_N,
            enabled: false,
            first: 0,
        }
    }

    /// Somebody else has taken its force away.
    pub fn was_disabled(&mut self) {
        self.enabled = false;
    }

    /// The largest force (N) that the arm may give by it now.
    pub fn largest_n(&self) -> f64 {
        self.largest_n
    }

    /// The normal that the arm has.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Puts the commands that bring the arm nearer to `wanted` into `text`, as many as `most` bytes hold: how many, and the bias force (N) that makes `force_n` of it `at` this place.
    ///
    /// `text` has room for more than `most`, and nothing else is in it.
    pub fn compose(
        &mut self,
        wanted: Option<&ContactPlane>,
        force_n: DVec3,
        at: At,
        text: &mut Vec<u8>,
        most: usize,
    ) -> (usize, DVec3) {
        let mut commands = Commands { text, most: most.saturating_sub(LARGEST_BYTES), count: 0 };
        let in_reach = |plane: &&ContactPlane| {
            plane.point_m.abs().max_element() <= FARTHEST_M && plane.stiffness_n_per_m <= STIFFEST_N_PER_M
        };
        let Some(wanted) = wanted.filter(in_reach) else {
            if self.enabled && commands.add(1, |text| drop(write!(text, "set {PLANE} disable"))) {
                self.enabled = false;
            }
            return (commands.count, force_n - self.normal_force_n(at) * self.normal);
        };
        let told = self.tell(wanted, &mut commands);
        if told && !self.enabled {
            self.enabled = commands.add(1, |text| drop(write!(text, "set {PLANE} enable")));
        }
        commands.most = most;
        let bias_n = self.bias_n(wanted, force_n, at, &mut commands);
        (commands.count, bias_n)
    }

    /// Place, stiffness and damping; whether the arm has them all then.
    fn tell(&mut self, wanted: &ContactPlane, commands: &mut Commands<'_>) -> bool {
        let (p, n) = (rounded(wanted.point_m, 1e6), rounded(wanted.normal, 1e5));
        let k = (wanted.stiffness_n_per_m * 10.0).round() / 10.0;
        let damped = self.damp_factor.of(wanted.damping_n_s_per_m, k);
        let b = if damped.is_finite() { (damped * 1e4).round() / 1e4 } else { 0.0 };
        self.first = (self.first + 1) % 3;
        let mut told = true;
        for part in (0..3).map(|i| (self.first + i) % 3) {
            told &= match part {
                // A place and its normal belong together.
                0 if (p, n) != (self.point_m, self.normal) => {
                    let fits = commands.add(2, |text| {
                        let _ = write!(text, "set {PLANE} {POSITION} [{:.6},{:.6},{:.6}];", p.x, p.y, p.z);
                        let _ = write!(text, "set {PLANE} normal [{:.5},{:.5},{:.5}]", n.x, n.y, n.z);
                    });
                    if fits {
                        (self.point_m, self.normal) = (p, n);
                    }
                    fits
                }
                1 if k != self.stiffness_n_per_m => {
                    let fits = commands.add(1, |text| drop(write!(text, "set {PLANE} stiffness {k:.1}")));
                    if fits {
                        self.stiffness_n_per_m = k;
                    }
                    fits || (k - self.stiffness_n_per_m).abs() <= ENABLED_WITHIN * k
                }
                2 if b != self.dampfactor => {
                    let fits = commands.add(1, |text| drop(write!(text, "set {PLANE} dampfactor {b:.4}")));
                    if fits {
                        self.dampfactor = b;
                    }
                    fits || (b - self.dampfactor).abs() <= ENABLED_WITHIN * b
                }
                _ => true,
            };
        }
        told
    }

    /// What is left of the force (N), and with it the largest that the plane may give until the next request.
    ///
    /// With a bias b and a limit L that is the largest f ≥ 0 with `|b + f n| ≤ L`: `f = −b·n + √(L² − |b|² + (b·n)²)`.
    fn bias_n(&mut self, wanted: &ContactPlane, force_n: DVec3, at: At, commands: &mut Commands<'_>) -> DVec3 {
        let limit_n = wanted.max_force_n;
        if !self.enabled {
            return force_n;
        }
        let n = self.normal;
        let given_n = ContactPlane { max_force_n: limit_n, ..self.on_arm() }.normal_force_n(at.0, at.1);
        let bias_n = (force_n - given_n * n).clamp_length_max(limit_n);
        let along_n = bias_n.dot(n);
        let room_n = (limit_n * limit_n - bias_n.length_squared() + along_n * along_n).max(0.0).sqrt() - along_n;
        // Rounded down, and never to what may mean no bound.
        let largest_n = ((room_n.min(limit_n) * 1e3).floor() / 1e3).max(LEAST_FORCE_N);
        let is_too_low = largest_n > self.largest_n + RAISED_BY * limit_n || self.largest_n < given_n;
        if (largest_n < self.largest_n || is_too_low)
            && commands.add(1, |text| drop(write!(text, "set {PLANE} {LARGEST} {largest_n:.3}")))
        {
            self.largest_n = largest_n;
        }
        bias_n
    }

    /// The plane that the arm has.
    fn on_arm(&self) -> ContactPlane {
        let k = self.stiffness_n_per_m;
        ContactPlane {
            point_m: self.point_m,
            normal: self.normal,
            stiffness_n_per_m: k,
            damping_n_s_per_m: self.damp_factor.damping_n_s_per_m(self.dampfactor, k),
            max_force_n: self.largest_n,
        }
    }

    /// Its force (N) on an arm there.
    fn normal_force_n(&self, at: At) -> f64 {
        if self.enabled { self.on_arm().normal_force_n(at.0, at.1) } else { 0.0 }
    }
}

/// Bytes of `;set contact outward_forcemax 100.000`.
const LARGEST_BYTES: usize = 6 + PLANE.len() + LARGEST.len() + 8;

fn rounded(v: DVec3, per_unit: f64) -> DVec3 {
    // Adding 0 makes −0 none, which would be told again and again.
    (v * per_unit).round() / per_unit + DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dampfactor_is_a_share_of_critical_damping_or_as_it_is() {
        // 2 √(200 · 2) = 40 N s/m.
        let ratio = DampFactor::Ratio { inertia_kg: 2.0 };
        assert!((ratio.of(28.0, 200.0) - 0.7).abs() < 1e-12);
        assert_eq!(DampFactor::Coefficient.of(28.0, 200.0), 28.0);
        for factor in [ratio, DampFactor::Coefficient] {
            assert!((factor.damping_n_s_per_m(factor.of(3.0, 500.0), 500.0) - 3.0).abs() < 1e-12);
        }
    }

    /// An arm that moves is told of no damping twice: where it is and as it moves, plane and bias are the force.
    #[test]
    fn what_a_moving_arm_is_given_is_the_force() {
        let wanted = ContactPlane {
            point_m: DVec3::ZERO,
            normal: DVec3::Z,
            stiffness_n_per_m: 500.0,
            damping_n_s_per_m: 10.0,
            max_force_n: 5.0,
        };
        let at = (DVec3::Z * -2e-3, DVec3::new(0.1, 0.0, -0.1));
        let force_n = DVec3::new(0.3, 0.0, 2.0);
        let mut plane = Plane::new(PlaneSettings { damp_factor: DampFactor::Ratio { inertia_kg: 2.0 } });
        let mut text = Vec::new();
        let bias_n = (0..3).map(|_| {
            text.clear();
            plane.compose(Some(&wanted), force_n, at, &mut text, 200).1
        });
        // 500 · 2 mm + 10 · 0.1 = 2 N.
        let bias_n = bias_n.last().unwrap();
        assert!((bias_n - DVec3::X * 0.3).length() < 1e-3, "{bias_n}");
        assert_eq!(plane.compose(Some(&wanted), force_n, at, &mut text, 200).0, 0, "nothing is told twice");
        text.clear();
        assert_eq!(plane.compose(None, force_n, at, &mut text, 200), (1, force_n));
        assert_eq!(text, b"set contact disable");
    }
}
