//! Parser of the specialization constants that the shaders declare. build.rs uses this file to generate Rust from
//! them.
//!
//! Each constant has one number, one name and one type in all shaders. A shader declares it as
//! `layout(constant_id = CONSTANT_X) const bool X = false;`, and layout.glsl gives its number by
//! `#define CONSTANT_X 7u`.

use std::collections::BTreeMap;

/// Declaration of a constant in a shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// The constant's name in GLSL and in Rust.
    pub name: String,
    /// `uint` or `bool`.
    pub glsl_type: String,
    /// The constant's number.
    pub id: u32,
}

/// Numbers that layout.glsl gives to constants, by the constants' names without `CONSTANT_`.
pub type Numbers = BTreeMap<String, u32>;

/// Reads the numbers from layout.glsl.
///
/// # Errors
/// Two constants have the same number, or what follows a name is not a number.
pub fn numbers(layout: &str) -> Result<Numbers, String> {
    let mut numbers = Numbers::new();
    for line in layout.lines() {
        let Some((name, number)) = line.strip_prefix("#define CONSTANT_").and_then(|rest| rest.split_once(' ')) else {
            continue;
        };
        let number = number.trim().trim_end_matches('u').parse().map_err(|_| format!("layout.glsl: {line}"))?;
        if let Some((other, _)) = numbers.iter().find(|(_, known)| **known == number) {
            return Err(format!("layout.glsl: the constants {other} and {name} have the same number {number}"));
        }
        numbers.insert(name.to_owned(), number);
    }
    Ok(numbers)
}

/// Reads the constants that one file declares, without those of the files that it includes.
///
/// # Errors
/// A constant has no number in layout.glsl, it has the number of another one, or Rust does not know its type. A
/// declaration is not written as this file expects.
pub fn declarations(file: &str, source: &str, numbers: &Numbers) -> Result<Vec<Declaration>, String> {
    let mut declarations = Vec::new();
    for (line_ix, line) in source.lines().enumerate() {
        let code = line.split("//").next().unwrap_or_default().trim();
        if !code.contains("constant_id") {
            continue;
        }
        let wrong = |what: &str| format!("glsl/{file}:{}: {what}: {}", line_ix + 1, line.trim());
        let rest = code.strip_prefix("layout(constant_id = ").ok_or_else(|| wrong("write `layout(constant_id = `"))?;
        let (number, rest) = rest.split_once(") const ").ok_or_else(|| wrong("no specialization constant"))?;
        let mut words = rest.split_whitespace();
        let (glsl_type, name) = words.next().zip(words.next()).ok_or_else(|| wrong("no type or name"))?;
        let id = *numbers.get(name).ok_or_else(|| wrong("layout.glsl has no number for this constant"))?;
        if number != format!("CONSTANT_{name}") {
            return Err(wrong("this is another constant's number"));
        }
        if !["uint", "bool"].contains(&glsl_type) {
            return Err(wrong("a constant is a uint or a bool"));
        }
        declarations.push(Declaration { name: name.to_owned(), glsl_type: glsl_type.to_owned(), id });
    }
    Ok(declarations)
}

/// Generates Rust for the constants of all shaders, with the names of the constants that each shader declares.
///
/// # Errors
/// Two shaders give one constant different types.
pub fn rust(shaders: &[(String, Vec<Declaration>)]) -> Result<String, String> {
    let mut all: BTreeMap<&str, &Declaration> = BTreeMap::new();
    for (file, declarations) in shaders {
        for declaration in declarations {
            let known = all.entry(&declaration.name).or_insert(declaration);
            if known.glsl_type != declaration.glsl_type {
                let Declaration { name, glsl_type, .. } = declaration;
                return Err(format!(
                    "glsl/{file}: the constant {name} is a {glsl_type}, elsewhere a {}",
                    known.glsl_type
                ));
            }
        }
    }
    let constant = |declaration: &&Declaration| {
        let Declaration { name, glsl_type, id } = declaration;
        let rust_type = if glsl_type == "uint" { "u32" } else { "bool" };
        format!("    pub const {name}: Constant<{rust_type}> = Constant::new({name:?}, {id});\n")
    };
    let constants: String = all.values().map(constant).collect();
    let of_shader = |(file, declarations): &(String, Vec<Declaration>)| {
        let names: Vec<_> = declarations.iter().map(|declaration| &declaration.name).collect();
        format!("    ({file:?}, &{names:?}),\n")
    };
    let shaders: String = shaders.iter().map(of_shader).collect();
    Ok(format!(
        "/// Specialization constants of the kernels.\npub mod constants {{\n    use crate::gpu::Constant;\n\
         {constants}}}\n\n/// The names of the constants that each shader declares, by its file.\n\
         pub const CONSTANTS_OF_SHADERS: &[(&str, &[&str])] = &[\n{shaders}];\n"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYOUT: &str = "#define CONSTANT_COUNTS 2u\n#define CONSTANT_TRAVERSAL 0u\n#define OTHER 2u\n";
    const COUNTS: &str = "layout(constant_id = CONSTANT_COUNTS) const bool COUNTS = true;";

    fn refusal(source: &str) -> String {
        declarations("x.comp", source, &numbers(LAYOUT).unwrap()).expect_err("a refusal")
    }

    #[test]
    fn constants_become_rust_of_their_type() {
        let numbers = numbers(LAYOUT).unwrap();
        let traversal = "layout(constant_id = CONSTANT_TRAVERSAL) const uint TRAVERSAL = A;";
        let found = declarations("x.comp", &format!("{COUNTS}\n{traversal}"), &numbers).unwrap();
        let rust = rust(&[("x.comp".to_owned(), found)]).unwrap();
        assert!(rust.contains(r#"pub const COUNTS: Constant<bool> = Constant::new("COUNTS", 2);"#), "{rust}");
        assert!(rust.contains(r#"pub const TRAVERSAL: Constant<u32> = Constant::new("TRAVERSAL", 0);"#), "{rust}");
        assert!(rust.contains(r#"("x.comp", &["COUNTS", "TRAVERSAL"])"#), "{rust}");
    }

    #[test]
    fn numbers_that_are_unknown_or_swapped_are_refused() {
        let swapped = refusal("\nlayout(constant_id = CONSTANT_TRAVERSAL) const bool COUNTS = true;");
        assert!(swapped.starts_with("glsl/x.comp:2: this is another constant's number"), "{swapped}");
        let literal = refusal("layout(constant_id = 2) const bool COUNTS = true;");
        assert!(literal.contains("another constant's number"), "{literal}");
        let unknown = refusal("layout(constant_id = CONSTANT_NEW) const bool NEW = true;");
        assert!(unknown.contains("no number"), "{unknown}");
        let spaced = refusal("layout(constant_id=2) const bool COUNTS = true;");
        assert!(spaced.contains("write `layout"), "{spaced}");
        let of_type = refusal("layout(constant_id = CONSTANT_COUNTS) const float COUNTS = 1.0;");
        assert!(of_type.contains("a uint or a bool"), "{of_type}");
    }

    #[test]
    fn one_number_for_two_constants_is_refused() {
        let twice = numbers("#define CONSTANT_A 1u\n#define CONSTANT_B 1u\n").expect_err("a refusal");
        assert_eq!(twice, "layout.glsl: the constants A and B have the same number 1");
    }

    #[test]
    fn two_types_of_one_constant_are_refused() {
        let declaration = |ty: &str| Declaration { name: "A".to_owned(), glsl_type: ty.to_owned(), id: 1 };
        let shaders = ["uint", "bool"].map(|ty| (format!("{ty}.comp"), vec![declaration(ty)]));
        assert_eq!(
            rust(&shaders).expect_err("a refusal"),
            "glsl/bool.comp: the constant A is a bool, elsewhere a uint"
        );
    }
}
