//! The XML of an XDMF file as a tree, and the paths by which its elements refer to others.
use crate::files::cursor::{line_number, shown};
use crate::files::error::{FileError, Place, Problem};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::path::Path;

/// Elements within elements within elements: more are no mesh, and following them would need a deep stack.
const DEEPEST: usize = 64;

/// An element; others are named by their index.
#[derive(Debug, Default)]
pub(super) struct Element {
    /// Without the prefix of its name space.
    pub(super) name: String,
    attributes: Vec<(String, String)>,
    pub(super) text: String,
    children: Vec<usize>,
    /// Where it is in the file.
    at: usize,
}

/// All elements in the order of the file. The first has the root as its child.
#[derive(Debug)]
pub(super) struct Document<'a> {
    pub(super) path: &'a Path,
    data: &'a [u8],
    elements: Vec<Element>,
}

impl<'a> Document<'a> {
    pub(super) fn parse(path: &'a Path, data: &'a [u8]) -> Result<Self, FileError> {
        let mut document = Self { path, data, elements: vec![Element::default()] };
        let text = std::str::from_utf8(data).map_err(|error| {
            let found = shown(&data[error.valid_up_to()..]);
            document.fail_at(error.valid_up_to(), Problem::Expected { wanted: "text in XML".to_string(), found })
        })?;
        let mut reader = Reader::from_str(text);
        let mut open = vec![0];
        loop {
            let at = reader.buffer_position() as usize;
            let event = reader.read_event().map_err(|error| {
                let found = shown(error.to_string().as_bytes());
                document.fail_at(at, Problem::Expected { wanted: "well-formed XML".to_string(), found })
            })?;
            let innermost = *open.last().unwrap_or(&0);
            match event {
                Event::Start(start) => {
                    if open.len() > DEEPEST {
                        let what = format!("elements lie more than {DEEPEST} deep in each other");
                        let instead = "write the mesh as one grid".to_string();
                        return Err(document.fail_at(at, Problem::Unsupported { what, instead }));
                    }
                    let element = document.add(innermost, &start, at);
                    open.push(element);
                }
                Event::Empty(start) => drop(document.add(innermost, &start, at)),
                Event::End(_) => drop(open.pop()),
                Event::Text(words) => document.elements[innermost].text.push_str(&words.into_inner()),
                Event::CData(words) => document.elements[innermost].text.push_str(&words.into_inner()),
                Event::Eof => break,
                _ => {}
            }
        }
        if let Some(&element) = open.get(1) {
            let wanted = format!("`</{}>`", document.element(element).name);
            return Err(document.fail_at(data.len(), Problem::Truncated { wanted }));
        }
        Ok(document)
    }

    fn add(&mut self, parent: usize, start: &BytesStart, at: usize) -> usize {
        let own = |bytes: &[u8]| {
            let name = String::from_utf8_lossy(bytes).into_owned();
            name.rsplit(':').next().map(str::to_owned).unwrap_or_default()
        };
        let attributes = start
            .attributes()
            .filter_map(Result::ok)
            .filter_map(|attribute| {
                let value = attribute.normalized_value(XmlVersion::Implicit1_0).ok()?.into_owned();
                Some((own(attribute.key.as_ref().as_ref()), value))
            })
            .collect();
        let name = own(start.name().as_ref().as_ref());
        let index = self.elements.len();
        self.elements.push(Element { name, attributes, at, ..Element::default() });
        self.elements[parent].children.push(index);
        index
    }

    pub(super) fn element(&self, index: usize) -> &Element {
        &self.elements[index]
    }

    /// An error at an element.
    pub(super) fn fail(&self, element: usize, problem: Problem) -> FileError {
        self.fail_at(self.elements[element].at, problem)
    }

    fn fail_at(&self, at: usize, problem: Problem) -> FileError {
        FileError::new(self.path, Place::Line(line_number(&self.data[..at.min(self.data.len())])), problem)
    }

    /// The root, if it is called so.
    pub(super) fn root(&self, name: &str) -> Option<usize> {
        self.elements[0].children.iter().copied().find(|&child| self.elements[child].name == name)
    }

    /// The children of an element, those that it includes in their places.
    pub(super) fn children(&self, element: usize) -> Result<Vec<usize>, FileError> {
        let mut all = Vec::new();
        for &child in &self.elements[element].children {
            let included = &self.elements[child];
            if included.name != "include" {
                all.push(self.referred(child)?);
                continue;
            }
            if let Some(file) = included.attribute(&["href"]).filter(|file| !file.is_empty()) {
                let what =
                    format!("a part of the mesh is to be included from another file, `{}`", shown(file.as_bytes()));
                let instead = "write the mesh into one XDMF file".to_string();
                return Err(self.fail(child, Problem::Unsupported { what, instead }));
            }
            let pointer = included.attribute(&["xpointer"]).unwrap_or_default().trim();
            let path = pointer.strip_prefix("xpointer(").and_then(|path| path.strip_suffix(')')).unwrap_or(pointer);
            all.extend(self.find(child, path)?);
        }
        Ok(all)
    }

    /// The element that stands for one with a `Reference`, whose value or, for the value `XML`, whose text is its path.
    fn referred(&self, element: usize) -> Result<usize, FileError> {
        let Some(reference) = self.elements[element].attribute(&["Reference"]) else { return Ok(element) };
        let path = if reference == "XML" { self.elements[element].text.trim() } else { reference };
        self.find(element, path)?.first().copied().ok_or_else(|| self.lost(element, path))
    }

    fn lost(&self, from: usize, path: &str) -> FileError {
        let what = format!("refers to `{}`, which is not in the file", shown(path.as_bytes()));
        self.fail(from, Problem::Inconsistent { what })
    }

    /// The elements that a path means: steps such as `Grid`, `*`, `Grid[2]`, `Grid[@Name="mesh"]` and
    /// `*[self::Topology or self::Geometry]`, behind `/` or, anywhere below, `//`.
    fn find(&self, from: usize, path: &str) -> Result<Vec<usize>, FileError> {
        let not_read = || {
            let what = format!("the reference `{}` is not read", shown(path.as_bytes()));
            let instead = "write the mesh as one grid that has its own Topology and Geometry".to_string();
            self.fail(from, Problem::Unsupported { what, instead })
        };
        let mut steps = steps_of(path).into_iter();
        if steps.next() != Some("") {
            return Err(not_read());
        }
        let mut found = vec![0];
        for step in steps {
            if step.is_empty() {
                found = self.all_below(found);
                continue;
            }
            let step = Step::parse(step).ok_or_else(not_read)?;
            found = found.iter().flat_map(|&parent| self.take_step(parent, &step)).collect();
            found.sort_unstable();
            found.dedup();
        }
        if found.is_empty() { Err(self.lost(from, path)) } else { Ok(found) }
    }

    /// Elements and whatever is in them.
    fn all_below(&self, mut open: Vec<usize>) -> Vec<usize> {
        let mut seen = vec![false; self.elements.len()];
        while let Some(element) = open.pop() {
            if !std::mem::replace(&mut seen[element], true) {
                open.extend(&self.elements[element].children);
            }
        }
        (0..seen.len()).filter(|&element| seen[element]).collect()
    }

    fn take_step(&self, parent: usize, step: &Step) -> Vec<usize> {
        let children = self.elements[parent].children.iter().copied();
        let mut chosen: Vec<usize> =
            children.filter(|&child| step.name == "*" || self.elements[child].name == step.name).collect();
        for condition in &step.conditions {
            match condition {
                Condition::Place(place) => chosen = chosen.get(place.wrapping_sub(1)).copied().into_iter().collect(),
                Condition::Attribute(key, value) => {
                    chosen.retain(|&child| self.elements[child].attribute(&[key]) == Some(value));
                }
                Condition::Named(names) => chosen.retain(|&child| names.contains(&self.elements[child].name.as_str())),
            }
        }
        chosen
    }
}

impl Element {
    /// The value of the first of these attributes that is there; version 3 of XDMF renamed some.
    pub(super) fn attribute(&self, keys: &[&str]) -> Option<&str> {
        let value = |key: &&str| self.attributes.iter().find(|(own, _)| own == key).map(|(_, value)| value.as_str());
        keys.iter().find_map(value)
    }
}

/// The parts between the slashes, but not those within brackets or quotes.
fn steps_of(path: &str) -> Vec<&str> {
    let (mut steps, mut start, mut depth, mut quote) = (Vec::new(), 0, 0usize, None);
    for (at, character) in path.char_indices() {
        if let Some(open) = quote {
            quote = (character != open).then_some(open);
            continue;
        }
        match character {
            '"' | '\'' => quote = Some(character),
            '[' => depth += 1,
            ']' => depth = depth.saturating_sub(1),
            '/' if depth == 0 => {
                steps.push(&path[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    steps.push(&path[start..]);
    steps
}

/// A name or `*`, and what must hold.
struct Step<'p> {
    name: &'p str,
    conditions: Vec<Condition<'p>>,
}

enum Condition<'p> {
    /// The so manieth of those that are left, from 1.
    Place(usize),
    Attribute(&'p str, &'p str),
    Named(Vec<&'p str>),
}

impl<'p> Step<'p> {
    fn parse(text: &'p str) -> Option<Self> {
        let end = text.find('[').unwrap_or(text.len());
        let (name, mut rest) = (text[..end].trim(), text[end..].trim());
        let mut conditions = Vec::new();
        while let Some(behind) = rest.strip_prefix('[') {
            let close = behind.find(']')?;
            conditions.push(Condition::parse(behind[..close].trim())?);
            rest = behind[close + 1..].trim();
        }
        (rest.is_empty() && !name.is_empty() && !name.contains(['(', ':', '.', '@']))
            .then_some(Self { name, conditions })
    }
}

impl<'p> Condition<'p> {
    fn parse(text: &'p str) -> Option<Self> {
        if let Ok(place) = text.parse() {
            return Some(Self::Place(place));
        }
        if let Some((key, value)) = text.strip_prefix('@').and_then(|text| text.split_once('=')) {
            let value = value.trim();
            let quoted = |quote: char| value.strip_prefix(quote).and_then(|value| value.strip_suffix(quote));
            return Some(Self::Attribute(key.trim(), quoted('"').or_else(|| quoted('\''))?));
        }
        text.split(" or ").map(|name| name.trim().strip_prefix("self::")).collect::<Option<Vec<_>>>().map(Self::Named)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "<?xml version='1.0'?><!DOCTYPE Xdmf SYSTEM 'Xdmf.dtd' []>\n<Xdmf xmlns:xi='x'><Domain>\
        <Grid Name='a/b' GridType='Uniform'><Topology/><Geometry/><Time/></Grid>\n\
        <Grid Name='c' GridType='Collection'><Grid Name='d' GridType='Uniform'><Geometry/></Grid></Grid>\
        </Domain></Xdmf>";

    #[test]
    fn paths() {
        let document = Document::parse(Path::new("a.xdmf"), TEXT.as_bytes()).unwrap();
        let names = |path: &str| -> Vec<String> {
            let found = document.find(0, path).unwrap();
            let named =
                |index: usize| document.element(index).attribute(&["Name"]).unwrap_or(&document.element(index).name);
            found.into_iter().map(|index| named(index).to_owned()).collect()
        };
        assert_eq!(names("/Xdmf/Domain/Grid"), ["a/b", "c"]);
        assert_eq!(names("/Xdmf/Domain/Grid[2]"), ["c"]);
        assert_eq!(
            names("/Xdmf/Domain/Grid[@GridType='Uniform'][1]/*[self::Topology or self::Geometry]"),
            ["Topology", "Geometry"]
        );
        assert_eq!(names("//Grid[@Name=\"a/b\"]/*[3]"), ["Time"]);
        assert_eq!(names("//Grid[@GridType='Uniform']"), ["a/b", "d"]);
        assert_eq!(names("/Xdmf//Geometry"), ["Geometry", "Geometry"]);
        for (path, told) in [
            ("/Xdmf/Grid", "line 1: refers to `/Xdmf/Grid`, which is not in the file"),
            ("Grid", "the reference `Grid` is not read"),
            ("/Xdmf/Domain/Grid[last()]", "is not read"),
            ("/Xdmf/Domain/..", "is not read"),
        ] {
            let error = document.find(0, path).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }

    #[test]
    fn what_is_no_document_is_told() {
        let told = |text: &str| Document::parse(Path::new("a.xdmf"), text.as_bytes()).unwrap_err().to_string();
        assert!(told("<Xdmf>\n<Domain>").contains("line 2: the file ends where `</Xdmf>` was expected"));
        assert!(told("<Xdmf>\n</Domain></Xdmf>").contains("line 2: expected well-formed XML"));
        assert!(told(&"<a>".repeat(70)).contains("more than 64 deep"));
    }
}
