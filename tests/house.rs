//! The house of `rust/src`: imports go along the map in `lib.rs`, and `cargo fmt` sees every file.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A row of the map.
struct Room {
    name: String,
    /// None: every room.
    may_import: Option<BTreeSet<String>>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("rust/src")
}

/// The map, from the top down.
fn map() -> Vec<Room> {
    let text = fs::read_to_string(root().join("lib.rs")).unwrap();
    let rows = text.lines().skip_while(|line| !line.starts_with("//! | room |")).skip(2);
    rows.map_while(|line| line.strip_prefix("//! | "))
        .map(|row| {
            let cells: Vec<&str> = row.trim_end_matches('|').split('|').map(str::trim).collect();
            let [room, _, allowed] = cells[..] else { panic!("a row of the map without three cells: {row}") };
            let names = allowed.split(", ").filter(|name| !name.is_empty()).map(str::to_owned);
            Room {
                name: room.trim_matches(['[', ']', '`']).to_owned(),
                may_import: (allowed != "every room").then(|| names.collect()),
            }
        })
        .collect()
}

/// All source files, by their path below `rust/src`.
fn files() -> BTreeMap<String, String> {
    fn collect(folder: &Path, out: &mut BTreeMap<String, String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(&path, out);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(root()).unwrap().to_str().unwrap().replace('\\', "/");
                out.insert(name, fs::read_to_string(&path).unwrap());
            }
        }
    }
    let mut out = BTreeMap::new();
    collect(&root(), &mut out);
    out
}

/// The text without comments.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// The name in a line that declares a module, and whether it has its body there.
fn module(line: &str) -> Option<(&str, bool)> {
    let line = line.strip_prefix("pub ").or_else(|| line.strip_prefix("pub(crate) ")).unwrap_or(line);
    let name = line.strip_prefix("mod ")?;
    name.strip_suffix(';').map(|name| (name, false)).or_else(|| Some((name.strip_suffix(" {")?, true)))
}

/// The code that is no test's: without modules that only tests have, which may import what they like. Files of such
/// modules go to `tests`.
fn without_tests(file: &str, text: &str, tests: &mut BTreeSet<String>) -> String {
    let mut out = String::new();
    let mut lines = code(text).lines().map(str::to_owned).collect::<Vec<_>>().into_iter();
    while let Some(line) = lines.next() {
        if line != "#[cfg(test)]" {
            out += &line;
            out.push('\n');
            continue;
        }
        let next = lines.next().unwrap_or_default();
        match module(&next) {
            // To its closing bracket at the line's beginning, as cargo fmt puts it.
            Some((_, true)) => while lines.next().is_some_and(|line| line != "}") {},
            Some((name, false)) => drop(tests.insert(path_of(file, name))),
            None => {}
        }
    }
    out
}

/// Where module `name`, declared in `file`, lies, without the ending.
fn path_of(file: &str, name: &str) -> String {
    let folder = match file.rsplit_once('/') {
        Some((folder, "mod.rs")) => format!("{folder}/"),
        None => String::new(),
        Some(_) => format!("{}/", file.trim_end_matches(".rs")),
    };
    format!("{folder}{name}")
}

/// The room that a file belongs to.
fn room_of(file: &str) -> &str {
    file.split('/').next().unwrap_or(file).trim_end_matches(".rs")
}

/// The rooms that some code names by `crate::`.
fn imports(code: &str) -> BTreeSet<&str> {
    let end = |rest: &str| rest.find(|c: char| c != '_' && !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
    code.split("crate::").skip(1).map(|rest| &rest[..end(rest)]).filter(|name| !name.is_empty()).collect()
}

#[test]
fn imports_go_along_the_map() {
    let (map, files) = (map(), files());
    let place: BTreeMap<&str, usize> = map.iter().enumerate().map(|(k, room)| (room.name.as_str(), k)).collect();
    let mut faults = Vec::new();
    for room in &map {
        for other in room.may_import.iter().flatten() {
            if place.get(other.as_str()).is_none_or(|k| *k <= place[room.name.as_str()]) {
                faults.push(format!("the map lets {} import {other}, which does not stand below it", room.name));
            }
        }
    }
    let mut tests = BTreeSet::new();
    let product: BTreeMap<&str, String> =
        files.iter().map(|(file, text)| (file.as_str(), without_tests(file, text, &mut tests))).collect();
    for (file, code) in product {
        let own = room_of(file);
        let is_test = tests.iter().any(|t| file == format!("{t}.rs") || file.starts_with(&format!("{t}/")));
        if file == "lib.rs" || is_test {
            continue;
        }
        let Some(room) = place.get(own).map(|k| &map[*k]) else {
            faults.push(format!("{file}: its room stands in no row of the map in lib.rs"));
            continue;
        };
        for other in imports(&code) {
            if other != own && room.may_import.as_ref().is_some_and(|names| !names.contains(other)) {
                faults.push(format!("{file}: imports {other}; the map lets {own} import {:?}", room.may_import));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(map.len() > 10 && imports("use crate::real::Real;\ncrate::body::x()") == BTreeSet::from(["body", "real"]));
}

/// `cargo fmt` follows `mod` lines, but not into macros.
#[test]
fn every_file_is_declared_by_a_line_that_cargo_fmt_sees() {
    let files = files();
    let mut declared = BTreeSet::from(["lib".to_owned()]);
    for (file, text) in &files {
        // A declaration stands at the line's beginning, what a macro gets is indented.
        declared.extend(code(text).lines().filter_map(module).map(|(name, _)| path_of(file, name)));
    }
    let unseen: Vec<_> =
        files.keys().filter(|f| !declared.contains(f.trim_end_matches("/mod.rs").trim_end_matches(".rs"))).collect();
    assert!(unseen.is_empty(), "no mod line of its own: {unseen:?}");
}

/// The files beside a file that some of its code names by `super::`.
fn beside<'a>(file: &str, code: &str, files: &'a BTreeMap<String, String>) -> BTreeSet<&'a str> {
    let Some((folder, _)) = file.rsplit_once('/').filter(|(_, name)| *name != "mod.rs") else {
        return BTreeSet::new();
    };
    let end = |rest: &str| rest.find(|c: char| c != '_' && !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
    let names: BTreeSet<&str> = code.split("super::").skip(1).map(|rest| &rest[..end(rest)]).collect();
    let found = names.iter().filter_map(|name| files.get_key_value(&format!("{folder}/{name}.rs")));
    found.map(|(other, _)| other.as_str()).filter(|other| *other != file).collect()
}

#[test]
fn files_of_a_room_make_no_circles() {
    let files = files();
    let mut tests = BTreeSet::new();
    let mut arrows: BTreeMap<&str, BTreeSet<&str>> = files
        .iter()
        .map(|(file, text)| (file.as_str(), beside(file, &without_tests(file, text, &mut tests), &files)))
        .collect();
    assert!(arrows.values().map(BTreeSet::len).sum::<usize>() > 20);
    // Files that import none that is left are taken away, again and again; what stays stands in a circle, or above one.
    loop {
        let left: BTreeSet<&str> = arrows.keys().copied().collect();
        let before = arrows.len();
        arrows.retain(|_, others| others.iter().any(|other| left.contains(other)));
        if arrows.len() == before {
            break;
        }
    }
    assert!(arrows.is_empty(), "in a circle, or above one: {:?}", arrows.keys());
}
