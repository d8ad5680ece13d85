//! The page's section on skips.
use super::page::escape;
use crate::skips::{ELSEWHERE, Found, Skip};
use std::fmt::Write as _;

pub(super) fn section(out: &mut String, found: &[(Skip, Found)]) {
    if found.is_empty() {
        return;
    }
    out.push_str(
        "<h2 id=\"skips\">What is skipped</h2><p>What a scene does not need is not computed. Each line is one scene run twice, in turns: with \
         the skip, and with it switched off or, for rest data, with what is skipped done beside it. Exact skips must end in the same state, bit for bit; a bounded one may be as far from it as is said.</p><div class=\"wide\">\
         <table class=\"text\"><tr><th>skip</th><th>what is left out</th><th>measured in</th><th>µs a tick</th><th>without</th><th>saved</th>\
         <th>the same?</th></tr>",
    );
    for (skip, found) in found {
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{:.1}</td><td>{:.0} %</td>{}</tr>",
            escape(skip.name),
            escape(skip.what),
            escape(skip.scene),
            found.with.median_s * 1e6,
            found.without.median_s * 1e6,
            100.0 * found.saved(),
            sameness(skip, found)
        );
    }
    for (name, reason) in ELSEWHERE {
        let _ = write!(out, "<tr><td>{}</td><td colspan=\"6\">{}</td></tr>", escape(name), escape(reason));
    }
    out.push_str("</table></div>");
}

fn sameness(skip: &Skip, found: &Found) -> String {
    let class = if skip.is_kept(found) { "yes" } else { "no" };
    format!("<td class=\"{class}\">{}</td>", skip.sameness(found))
}
