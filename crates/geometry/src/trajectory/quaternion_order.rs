//! The order of a quaternion's numbers in files without named columns.

use serde::{Deserialize, Serialize};

/// The order of a quaternion's numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum QuaternionOrder {
    /// `qx qy qz qw`, as TUM has it.
    #[default]
    Xyzw,
    /// `qw qx qy qz`.
    Wxyz,
}

impl QuaternionOrder {
    /// Finds the order that the comments before the first line with content name: `qw qx qy qz`,
    /// `w x y z`, `q_w, q_x, q_y, q_z` and the like. The last four such words count, because
    /// `x y z` may be the translation before them.
    pub(super) fn of_comments(text: &str) -> Option<Self> {
        let lines = text.lines().map(str::trim);
        let comments = lines.take_while(|line| line.is_empty() || line.starts_with('#'));
        comments.filter_map(Self::of_comment).last()
    }

    fn of_comment(comment: &str) -> Option<Self> {
        let is_between = |c: char| !(c.is_alphanumeric() || c == '_');
        let letters: Vec<Option<char>> = comment
            .split(is_between)
            .filter(|word| !word.is_empty())
            .map(component)
            .collect();
        let mut orders = letters.windows(4).filter_map(|four| match four {
            [Some('x'), Some('y'), Some('z'), Some('w')] => Some(Self::Xyzw),
            [Some('w'), Some('x'), Some('y'), Some('z')] => Some(Self::Wxyz),
            _ => None,
        });
        orders.next_back()
    }

    /// Orders four numbers of a file as w, x, y, z.
    pub(super) fn wxyz(self, [a, b, c, d]: [f64; 4]) -> [f64; 4] {
        match self {
            Self::Xyzw => [d, a, b, c],
            Self::Wxyz => [a, b, c, d],
        }
    }

    /// The names of the numbers, in order.
    pub fn columns(self) -> &'static str {
        match self {
            Self::Xyzw => "qx qy qz qw",
            Self::Wxyz => "qw qx qy qz",
        }
    }
}

/// The component that a word such as `qw`, `w` or `q_RS_w` names.
fn component(word: &str) -> Option<char> {
    let word = word.to_lowercase();
    let letter = word.chars().last().filter(|c| "wxyz".contains(*c))?;
    (word.len() == 1 || word.starts_with('q')).then_some(letter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_name_the_order() {
        use QuaternionOrder::{Wxyz, Xyzw};
        for (comment, order) in [
            ("# timestamp tx ty tz qw qx qy qz", Some(Wxyz)),
            ("# time x y z w x y z", Some(Wxyz)),
            ("# time, x, y, z, q_w, q_x, q_y, q_z", Some(Wxyz)),
            (
                "#t p_x [m] p_y [m] p_z [m] q_RS_w [] q_RS_x [] q_RS_y [] q_RS_z []",
                Some(Wxyz),
            ),
            ("# timestamp tx ty tz qx qy qz qw", Some(Xyzw)),
            ("# time x y z x y z w", Some(Xyzw)),
            (
                "# TUM\n# time tx ty tz QW QX QY QZ\n\n# by hand",
                Some(Wxyz),
            ),
            ("# ground truth trajectory", None),
            ("# time tx ty tz qw qz qy qx", None),
            ("0 0 0 0 1 0 0 0\n# qw qx qy qz", None),
            ("", None),
        ] {
            assert_eq!(QuaternionOrder::of_comments(comment), order, "{comment}");
        }
    }
}
