//! Parser of the list of the scene's arrays, glsl/shared/scene_arrays.glsl. build.rs uses this file to generate Rust
//! from the list.

use std::fmt::Write;

/// Row of the list: one array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// The comment above the row, without `//`, line by line.
    pub doc: Vec<String>,
    /// The array's name in GLSL and in Rust. It is also the debug label of the array's buffer and the name of the
    /// buffer's allocation.
    pub name: String,
    /// The type of an element: `uint`, or a struct of layout.glsl.
    pub element: String,
    /// The type that a kernel loads at once: `uint`, `uvec2` or `vec4`.
    pub row: String,
    /// The number of the array's binding.
    pub binding: u32,
}

impl Row {
    /// The size of the type that a kernel loads at once, bytes.
    fn row_bytes(&self) -> usize {
        match self.row.as_str() {
            "uint" => 4,
            "uvec2" => 8,
            _ => 16,
        }
    }

    /// The type of an element in Rust.
    fn rust_element(&self) -> &str {
        if self.element == "uint" { "u32" } else { &self.element }
    }
}

/// Parses the list.
///
/// # Errors
/// A line is neither a comment nor `ARRAY(name, element, row, number)`, the type of a row is unknown, or two rows
/// have the same name or number.
pub fn rows(source: &str) -> Result<Vec<Row>, String> {
    let mut rows: Vec<Row> = Vec::new();
    let mut doc = Vec::new();
    for (line_ix, line) in source.lines().map(str::trim).enumerate() {
        let wrong = |what: &str| format!("glsl/shared/scene_arrays.glsl:{}: {what}: {line}", line_ix + 1);
        if line.is_empty() {
            doc.clear();
        } else if let Some(comment) = line.strip_prefix("//") {
            doc.push(comment.to_owned());
        } else {
            let inner = line.strip_prefix("ARRAY(").and_then(|rest| rest.strip_suffix(')'));
            let columns: Vec<_> = inner.into_iter().flat_map(|inner| inner.split(", ")).collect();
            let [name, element, row, number] = columns[..] else {
                return Err(wrong("write `ARRAY(name, element, row, number)`"));
            };
            if !["uint", "uvec2", "vec4"].contains(&row) {
                return Err(wrong("a row is a uint, a uvec2 or a vec4"));
            }
            let binding = number.strip_suffix('u').and_then(|number| number.parse().ok());
            let binding = binding.ok_or_else(|| wrong("a binding is a number such as 3u"))?;
            if rows.iter().any(|known| known.name == name || known.binding == binding) {
                return Err(wrong("another row has this name or binding"));
            }
            let [name, element, row] = [name, element, row].map(str::to_owned);
            rows.push(Row { doc: std::mem::take(&mut doc), name, element, row, binding });
        }
    }
    Ok(rows)
}

/// Checks the arrays' bindings against those that layout.glsl gives to other buffers.
///
/// # Errors
/// An array has the binding of another buffer, or one that is not below `BIND_TEXELS`.
pub fn check_bindings(rows: &[Row], layout: &str) -> Result<(), String> {
    let number_of = |value: &str| value.trim().trim_end_matches('u').parse::<u32>().ok();
    let defines = layout.lines().filter_map(|line| line.strip_prefix("#define ")?.split_once(' '));
    let numbers: Vec<_> = defines.filter_map(|(name, value)| Some((name, number_of(value)?))).collect();
    let end = numbers.iter().find(|(name, _)| *name == "BIND_TEXELS").map_or(u32::MAX, |(_, number)| *number);
    for Row { name, binding, .. } in rows {
        if let Some((other, _)) =
            numbers.iter().find(|(other, n)| other.starts_with("BIND_") && *n == *binding && *n != end)
        {
            return Err(format!("glsl/shared/scene_arrays.glsl: {name} has the binding {binding} of {other}"));
        }
        if *binding >= end {
            return Err(format!(
                "glsl/shared/scene_arrays.glsl: {name} has the binding {binding}, not below BIND_TEXELS"
            ));
        }
    }
    Ok(())
}

/// Generates Rust from the list: a macro, `for_scene_arrays!(with)`. It calls the macro `with` with a row
/// `/// doc name: element = binding,` for each array. The generated Rust does not compile unless `row` is as large as
/// the widest texel that divides an element.
pub fn rust(rows: &[Row]) -> String {
    let (mut list, mut checks, mut elements) = (String::new(), String::new(), String::new());
    for row in rows {
        let (Row { name, element, binding, .. }, bytes, rust_element) = (row, row.row_bytes(), row.rust_element());
        row.doc.iter().for_each(|line| writeln!(list, "        ///{line}").unwrap());
        writeln!(list, "        {name}: {rust_element} = {binding},").unwrap();
        let refusal = format!("scene_arrays.glsl: {name} has rows of {bytes} bytes, not of the widest that fits");
        writeln!(checks, "const _: () = assert!({bytes} == crate::gpu::texel_bytes::<{rust_element}>(), {refusal:?});")
            .unwrap();
        write!(elements, "({binding}, {element:?}), ").unwrap();
    }
    format!(
        "/// Calls a macro with the scene's arrays.\n\
         macro_rules! for_scene_arrays {{ ($with:ident) => {{ $with! {{\n{list}    }} }} }}\n\
         pub(crate) use for_scene_arrays;\n{checks}\n\
         /// The binding of each of the scene's arrays, and the type of its elements in GLSL.\n\
         #[cfg(test)]\nconst SCENE_ARRAYS: &[(u32, &str)] = &[{elements}];\n\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: &str = "// The list.\n\n// Nodes.\nARRAY(nodes, Node, uvec2, 5u)\nARRAY(links, uint, uint, 6u)\n";

    fn refusal(source: &str) -> String {
        rows(source).expect_err("a refusal")
    }

    #[test]
    fn rows_are_read_with_their_comments() {
        let found = rows(LIST).unwrap();
        let row = |doc: &[&str], [name, element, row]: [&str; 3], binding| Row {
            doc: doc.iter().map(|line| (*line).to_owned()).collect(),
            name: name.to_owned(),
            element: element.to_owned(),
            row: row.to_owned(),
            binding,
        };
        assert_eq!(found, [row(&[" Nodes."], ["nodes", "Node", "uvec2"], 5), row(&[], ["links", "uint", "uint"], 6)]);
        let rust = rust(&found);
        assert!(rust.contains("/// Nodes.\n        nodes: Node = 5,\n        links: u32 = 6,\n"), "{rust}");
        assert!(rust.contains("assert!(8 == crate::gpu::texel_bytes::<Node>()"), "{rust}");
    }

    #[test]
    fn rows_that_mean_nothing_are_refused() {
        let place = |line_ix: u32| format!("glsl/shared/scene_arrays.glsl:{line_ix}: ");
        assert!(refusal("\nARRAY(nodes, Node, 5u)").starts_with(&(place(2) + "write `ARRAY(")));
        assert!(refusal("nodes").starts_with(&(place(1) + "write `ARRAY(")));
        assert!(refusal("ARRAY(nodes, Node, vec3, 5u)").starts_with(&(place(1) + "a row is")));
        assert!(refusal("ARRAY(nodes, Node, vec4, 5)").starts_with(&(place(1) + "a binding is")));
        let twice = format!("{LIST}ARRAY(others, Node, uvec2, 6u)");
        assert!(refusal(&twice).starts_with(&(place(6) + "another row has")));
    }

    #[test]
    fn bindings_of_other_buffers_are_refused() {
        let list = rows(LIST).unwrap();
        let layout = "#define BIND_TEXELS 7u\n#define BIND_RAYS 4u\n";
        assert_eq!(check_bindings(&list, layout), Ok(()));
        let taken = check_bindings(&list, "#define BIND_RAYS 6u\n").expect_err("a refusal");
        assert_eq!(taken, "glsl/shared/scene_arrays.glsl: links has the binding 6 of BIND_RAYS");
        let beyond = check_bindings(&list[1..], "#define BIND_TEXELS 6u\n").expect_err("a refusal");
        assert!(beyond.ends_with("links has the binding 6, not below BIND_TEXELS"), "{beyond}");
    }
}
