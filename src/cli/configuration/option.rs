//! Options of a command with their values and sources.

use clap::Command;

/// An option of a command.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectiveOption {
    /// Its long flag, with underscores.
    pub name: String,
    /// Its values; none if it is not set.
    pub values: Vec<String>,
    /// True if it is a flag without a value.
    pub is_switch: bool,
    /// Source of its value.
    pub source: OptionSource,
}

/// Source of an option's value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OptionSource {
    /// The command line.
    Flag,
    /// The environment variable of this name.
    Variable(String),
    /// `survey.toml`.
    Survey,
    /// The default.
    Default,
}

impl OptionSource {
    /// Short text for the user.
    pub fn text(&self) -> String {
        match self {
            Self::Flag => "flag".to_owned(),
            Self::Variable(name) => name.clone(),
            Self::Survey => "survey.toml".to_owned(),
            Self::Default => "default".to_owned(),
        }
    }
}

impl EffectiveOption {
    /// Its value for TOML, if it has one.
    pub fn toml_value(&self) -> Option<toml::Value> {
        if self.is_switch {
            let is_set = self
                .values
                .first()
                .is_some_and(|value| !is_false(&value.to_lowercase()));
            return Some(toml::Value::Boolean(is_set));
        }
        match &self.values[..] {
            [] => None,
            [value] => Some(number_or_text(value)),
            values => {
                let list = values.iter().map(|value| number_or_text(value));
                Some(list.collect::<Vec<_>>().into())
            }
        }
    }
}

/// True if a value of a switch in an environment variable means false, as clap reads it.
pub(super) fn is_false(value: &str) -> bool {
    matches!(value, "" | "false" | "0" | "no" | "n" | "f" | "off")
}

fn number_or_text(text: &str) -> toml::Value {
    if let Ok(number) = text.parse::<i64>() {
        number.into()
    } else {
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => number.into(),
            _ => text.to_owned().into(),
        }
    }
}

/// Options as a table for `survey.toml`, without those that have no value.
pub fn options_table(options: &[EffectiveOption]) -> toml::Table {
    let set = options
        .iter()
        .filter_map(|option| Some((option.name.clone(), option.toml_value()?)));
    set.collect()
}

/// Options of the command `sub` with their long flags, global ones included.
pub(super) fn long_options<'a>(
    command: &'a Command,
    sub: &'a Command,
) -> impl Iterator<Item = (&'a clap::Arg, &'a str)> {
    let arguments = sub.get_arguments().chain(command.get_arguments());
    arguments.filter_map(|arg| {
        let long = arg.get_long()?;
        (!matches!(long, "help" | "version")).then_some((arg, long))
    })
}
