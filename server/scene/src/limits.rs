//! How large a scene may become.
use crate::document::{
    Document,
    region::Selector,
    source::{Fault, Where},
};
use std::{io, io::Read, path::Path};

/// Most tets of any body: what still fits into a large machine's memory.
pub(crate) const MOST_TETS: u32 = 10_000_000;

/// How large a scene may become. What asks for more is refused before anything of that size is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Tets of the body.
    pub tets: u32,
    /// Tables of one kind (`[[region]]`, `[[load]]`, …), and selectors in all regions together.
    pub entries: usize,
    /// Tools, each of which carries tables as large as the surface.
    pub tools: usize,
    /// Bytes of the scene, and of each file it names.
    pub file_bytes: u64,
}

impl Limits {
    /// For scenes of whoever started the program.
    pub fn local() -> Self {
        Self { tets: MOST_TETS, entries: 10_000, tools: 64, file_bytes: 4 << 30 }
    }

    /// For scenes that come over the network: loaded in seconds.
    pub fn wire() -> Self {
        Self { tets: 200_000, entries: 256, tools: 8, file_bytes: 1 << 20 }
    }

    /// Refuses a body of too many tets, wanted or present, at its key.
    pub(crate) fn check_tets(&self, at: &Where, tets: u64) -> Result<(), Fault> {
        if tets <= u64::from(self.tets) {
            return Ok(());
        }
        let message = format!("{at} gives {tets} tets; at most {} are allowed here", self.tets);
        let more =
            format!("coarsen it, or give the scene to palpated on its command line: there {MOST_TETS} are allowed");
        Err(Fault::value(at.clone(), message).help(if self.tets < MOST_TETS { &more } else { "coarsen it" }))
    }

    /// Refuses too many tables or selectors.
    pub(crate) fn check_entries(&self, document: &Document) -> Result<(), Fault> {
        let lists = [
            ("region", document.region.len()),
            ("material", document.material.len()),
            ("fixed", document.fixed.len()),
            ("prescribed", document.prescribed.len()),
            ("load", document.load.len()),
            ("probe", document.probe.len()),
        ];
        for (key, count) in lists {
            if count > self.entries {
                let message = format!("there are {count} [[{key}]]; at most {} are allowed here", self.entries);
                return Err(Fault::value(Where::root(key).index(self.entries), message).help("leave some out"));
            }
        }
        let tools = document.tool.len();
        if tools > self.tools {
            let message = format!("there are {tools} [[tool]]; at most {} are allowed here", self.tools);
            return Err(Fault::value(Where::root("tool").index(self.tools), message).help("leave some out"));
        }
        let mut selectors = 0;
        for (index, region) in document.region.iter().enumerate() {
            selectors += selectors_in(&region.select);
            if selectors > self.entries {
                let at = Where::root("region").index(index).key("select");
                let message =
                    format!("the regions have {selectors} selectors up to here; at most {} are allowed", self.entries);
                return Err(Fault::value(at, message).help("select with fewer"));
            }
        }
        Ok(())
    }

    /// The text of a file (or a pipe), if it is not too long.
    pub(crate) fn read_text(&self, path: &Path) -> io::Result<String> {
        let mut text = String::new();
        std::fs::File::open(path)?.take(self.file_bytes.saturating_add(1)).read_to_string(&mut text)?;
        if text.len() as u64 > self.file_bytes {
            let message = format!("it has more than {} bytes, which is the most allowed here", self.file_bytes);
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, message));
        }
        Ok(text)
    }
}

fn selectors_in(selector: &Selector) -> usize {
    let lists = [&selector.all_of, &selector.any_of].into_iter().flatten().flatten();
    1 + lists.chain(selector.not.as_deref()).map(selectors_in).sum::<usize>()
}
