//! Elements of XML files and the numbers in them.

use roxmltree::{Document, Node, ParsingOptions};

/// Most nodes of a file: an element of a camera has about twenty, and a node takes less than a
/// hundred bytes.
const MAX_NODES: u32 = 20_000_000;

/// Parses a text. Document type definitions, and with them entities, are refused.
pub fn parse(text: &str) -> Result<Document<'_>, String> {
    let options = ParsingOptions {
        nodes_limit: MAX_NODES,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options).map_err(|error| format!("is no valid XML: {error}"))
}

/// The child elements of a name.
pub fn children<'a, 'i>(
    node: Node<'a, 'i>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'i>> {
    let elements = node.children();
    elements.filter(move |child| child.has_tag_name(name))
}

/// The first child element of a name.
pub fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

/// The finite numbers of an element, separated by blanks.
pub fn numbers<const N: usize>(node: Node<'_, '_>) -> Result<[f64; N], String> {
    let name = node.tag_name().name();
    let words: Vec<&str> = node.text().unwrap_or_default().split_whitespace().collect();
    if words.len() != N {
        return Err(format!("{name} has {} numbers, not {N}", words.len()));
    }
    let mut numbers = [0.0; N];
    for (number, word) in numbers.iter_mut().zip(words) {
        let value = word.parse().ok().filter(|value: &f64| value.is_finite());
        *number = value.ok_or_else(|| format!("{name} holds `{word}`, which is no number"))?;
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_elements_are_counted() {
        let text = "<a><b>1 -2.5\n3</b><c>1 x</c><b/></a>";
        let document = parse(text).unwrap();
        let root = document.root_element();
        assert_eq!(children(root, "b").count(), 2);
        let b = child(root, "b").unwrap();
        assert_eq!(numbers(b), Ok([1.0, -2.5, 3.0]));
        assert_eq!(numbers::<2>(b), Err("b has 3 numbers, not 2".to_owned()));
        let said = numbers::<2>(child(root, "c").unwrap()).unwrap_err();
        assert_eq!(said, "c holds `x`, which is no number");
        assert!(child(root, "d").is_none());
    }

    #[test]
    fn entities_are_refused() {
        let text = "<!DOCTYPE a [<!ENTITY b \"c\">]><a>&b;</a>";
        assert!(parse(text).unwrap_err().contains("is no valid XML"));
    }
}
