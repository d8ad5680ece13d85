//! The registry of laws: its macro makes the enumeration, the list and both dispatches from one line per law.

/// From lines `module::TypeThatImplementsConstitutiveLaw`: the enumeration `Law` whose variants have the types' names,
/// the list of all of them, and the functions of a law by a `match`, so that each call is compiled for its law (no
/// `dyn`).
macro_rules! laws {
    ($($(#[$attribute:meta])* $module:ident::$law:ident),+ $(,)?) => {
        /// Which law a material obeys.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
        pub enum Law {
            $(#[doc = concat!("The law of [`", stringify!($module), "::", stringify!($law), "`].")] $(#[$attribute])* $law),+
        }

        impl Law {
            /// The names of [`Self::ALL`], in its order.
            pub const NAMES: &'static [&'static str] = &[$($module::$law::NAME),+];
            /// Every law there is.
            pub const ALL: [Self; Self::NAMES.len()] = [$(Self::$law),+];

            /// One sentence for the user who chooses a law.
            pub fn description(self) -> &'static str {
                match self { $(Self::$law => $module::$law::DESCRIPTION),+ }
            }
            /// The principal stretch (deformed over rest length) below which it bears less the more it is compressed;
            /// `None` where a law bears more with more compression.
            pub fn weakens_below(self) -> Option<f64> {
                match self { $(Self::$law => $module::$law::WEAKENS_BELOW),+ }
            }
            fn energy_density(self, lame: Lame, f: &DMat3) -> f64 {
                match self { $(Self::$law => $module::$law::energy_density(lame, f)),+ }
            }
            fn piola(self, lame: Lame, f: &DMat3) -> DMat3 {
                match self { $(Self::$law => $module::$law::piola(lame, f)),+ }
            }
            fn piola_differential(self, lame: Lame, f: &DMat3, df: &DMat3) -> DMat3 {
                match self { $(Self::$law => $module::$law::piola_differential(lame, f, df)),+ }
            }
            fn stretched_modulus_pa(self, lame: Lame, stretch_sq: f64) -> f64 {
                match self { $(Self::$law => $module::$law::stretched_modulus_pa(lame, stretch_sq)),+ }
            }
            /// Runs a pass that was compiled for this law and the instruction set, with viscous terms or without.
            pub(crate) fn run<P: LawPass>(self, set: Available, viscous: bool, pass: &mut P) -> f64 {
                match self { $(Self::$law => passes::run::<$module::$law, P>(set, viscous, pass)),+ }
            }
        }
    };
}
pub(super) use laws;
