//! Equilibrium: the static solve that references and `palpated static` use.
