//! The page's section on orders of convergence.
use super::page::escape;
use crate::convergence::Convergence;
use std::fmt::Write as _;

/// Orders of convergence, found in the same run.
pub(super) fn section(out: &mut String, studies: &[Convergence]) {
    if studies.is_empty() {
        return;
    }
    out.push_str(
        "<h2>Convergence</h2><p>Errors on successive refinements, each twice as fine, and the order p of the last: half the size takes the \
         error down by 2<sup>p</sup>. Space is judged by a manufactured solution (a body force made for a displacement that is known \
         everywhere, stable neo-Hookean, ν = 0.3, irregular meshes), time by a block that swings at large strain.</p>\
         <div class=\"wide\"><table><tr><th>what</th><th>refined</th><th>errors</th><th>order</th><th>demanded</th><th>met</th></tr>",
    );
    for study in studies {
        let list = |values: Vec<String>| values.join(", ");
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}: {}</td><td>{}</td><td>{:.2}</td><td>≥ {}</td>{}</tr>",
            escape(study.quantity),
            escape(study.refined),
            list(study.sizes.iter().map(u32::to_string).collect()),
            list(study.errors.iter().map(|e| format!("{e:.2e}")).collect()),
            study.order(),
            study.demand,
            if study.is_met() { "<td class=\"yes\">yes</td>" } else { "<td class=\"no\">no</td>" }
        );
    }
    out.push_str("</table></div>");
}
