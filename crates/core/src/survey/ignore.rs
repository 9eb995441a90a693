//! `[tunnel] ignore`: regions of the wall that are excluded from the comparison of frames.

use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::surface::{Surface, WallRegions};

/// A region of the wall; a missing bound does not limit it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IgnoreSection {
    /// Angles θ from and to, degrees, in the direction in which θ grows; may go through 0, as
    /// `[330, 30]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub theta_deg: Option<[f64; 2]>,
    /// Chainages from and to, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chainage_m: Option<[f64; 2]>,
}

/// Largest number of regions.
const MAX_REGIONS: usize = 10_000;
/// Largest plausible angle, degrees.
const MAX_ANGLE_DEG: f64 = 720.0;

impl IgnoreSection {
    /// Checks the bounds.
    fn validate(&self) -> Result<(), String> {
        match self {
            Self {
                theta_deg: None,
                chainage_m: None,
            } => Err(
                "says neither theta_deg nor chainage_m, which would be all of the wall".to_owned(),
            ),
            Self {
                theta_deg: Some([from, to]),
                ..
            } if !(from.abs() <= MAX_ANGLE_DEG && to.abs() <= MAX_ANGLE_DEG) || from == to => {
                Err(format!(
                    "theta_deg is [{from}, {to}]; it must be two different angles in degrees, \
                     from and to in the direction in which θ grows"
                ))
            }
            Self {
                chainage_m: Some([from, to]),
                ..
            } if !(from.is_finite() && to.is_finite() && from < to) => Err(format!(
                "chainage_m is [{from}, {to}]; it must be two numbers of metres, the smaller first"
            )),
            _ => Ok(()),
        }
    }
}

/// Converts the sections to regions of the wall of `surface`.
///
/// # Errors
/// The problem of the first invalid section.
pub(super) fn wall_regions(
    sections: &[IgnoreSection],
    surface: &dyn Surface,
) -> Result<WallRegions, String> {
    if sections.len() > MAX_REGIONS {
        return Err(format!(
            "tunnel.ignore has {} items, and at most {MAX_REGIONS} are read; combine neighbouring \
             ones",
            sections.len()
        ));
    }
    let mut patches = WallRegions::default();
    for (k, section) in sections.iter().enumerate() {
        section
            .validate()
            .map_err(|what| format!("tunnel.ignore, item {}: {what}", k + 1))?;
        let theta_rad = section.theta_deg.map(|theta| theta.map(f64::to_radians));
        patches.add(surface, theta_rad, section.chainage_m);
    }
    Ok(patches)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::Circle;

    #[test]
    fn impossible_parts_are_named() {
        let circle = Circle::new(3.0).unwrap();
        let good = "[{ theta_deg = [330, 30] }, { theta_deg = [-30, 30], chainage_m = [2, 5.5] }]";
        for (text, expected) in [
            (good, None),
            ("[{}]", Some("item 1: says neither")),
            ("[{ theta_deg = [20, 20] }]", Some("two different angles")),
            ("[{ theta_deg = [nan, 20] }]", Some("two different angles")),
            (
                "[{ chainage_m = [1, 2] }, { chainage_m = [5, 2] }]",
                Some("item 2: chainage_m is [5, 2]"),
            ),
            ("[{ chainage_m = [0, inf] }]", Some("the smaller first")),
        ] {
            let table: toml::Table = format!("ignore = {text}").parse().unwrap();
            let sections: Vec<IgnoreSection> = table["ignore"].clone().try_into().unwrap();
            let error = wall_regions(&sections, &circle).err();
            match expected {
                None => assert_eq!(error, None),
                Some(expected) => assert!(
                    error.as_deref().unwrap_or("").contains(expected),
                    "{error:?}"
                ),
            }
        }
        assert!(toml::from_str::<IgnoreSection>("theta = [1, 2]").is_err());
    }
}
