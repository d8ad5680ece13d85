//! The page's section on hearts: what ticks take on bodies that no method was tuned on.
use super::page::escape;
use crate::hearts::{self, HeartTicks};
use std::fmt::Write as _;

pub(super) fn section(out: &mut String, hearts: &[HeartTicks]) {
    if hearts.is_empty() {
        return;
    }
    let _ = write!(
        out,
        "<h2 id=\"hearts\">Hearts</h2><p>The problems above have known answers, and smooth and simple bodies. A heart as a segmentation gives it has neither. <code>hybrid-ventricle</code> is shipped; the \
         others are made of a seed each, with an axis, a septum, a valve and papillary muscles of its own and the noise of voxels. {} What is more than 1 000 µs does not fit into \
         a tick.</p><div class=\"wide\"><table><tr><th>heart</th><th>awake</th><th>substeps</th><th>at rest</th><th>dragged: median</th><th>p99</th><th>longest</th>\
         <th>substeps taken</th><th>mean force</th><th>swaying</th><th>asleep: after, median, p99</th></tr>",
        escape(&hearts::what())
    );
    for heart in hearts {
        let [median, p99, longest] = heart.dragged_us;
        let fits = |time_us: f64| if time_us < 1000.0 { "yes" } else { "no" };
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td class=\"{}\">{median:.0}</td><td class=\"{}\">{p99:.0}</td>\
             <td class=\"{}\">{longest:.0}</td><td>{:.1}</td><td>{:.3} N</td><td>{:.0}</td><td>{}</td></tr>",
            escape(&heart.name),
            heart.awake,
            heart.substeps,
            heart.rest_us,
            fits(median),
            fits(p99),
            fits(longest),
            heart.substeps_taken,
            heart.mean_force_n,
            heart.swaying_us,
            heart.asleep.map_or_else(|| "never".to_owned(), |asleep| asleep.to_string())
        );
    }
    out.push_str("</table></div>");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hearts::Asleep;

    #[test]
    fn a_tick_that_does_not_fit_is_marked() {
        let heart = HeartTicks {
            name: "1: a <heart>".into(),
            awake: 200,
            substeps: 4,
            rest_us: 300.0,
            dragged_us: [900.0, 1100.0, 2000.0],
            substeps_taken: 4.0,
            mean_force_n: 0.25,
            swaying_us: 310.0,
            asleep: Some(Asleep { after_s: 1.4, median_us: 4.4, p99_us: 11.0 }),
        };
        let mut out = String::new();
        section(&mut out, &[heart]);
        assert!(out.contains("<td class=\"yes\">900</td><td class=\"no\">1100</td>"), "{out}");
        assert!(out.contains("a &lt;heart&gt;") && out.contains("1.4 s, 4.4, 11.0"), "{out}");
        let mut none = String::new();
        section(&mut none, &[]);
        assert!(none.is_empty());
    }
}
