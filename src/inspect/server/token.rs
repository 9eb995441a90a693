//! The secret part of the server's address.
//!
//! Every program and user of this machine can connect to the loopback address; who does not know
//! the address that `view` prints sees nothing and changes nothing.

use std::hash::{BuildHasher, Hasher, RandomState};

/// A random token of 128 bits, the first part of every path.
#[derive(Clone, Debug)]
pub(super) struct Token(String);

impl Token {
    /// Draws a token. The keys of [`RandomState`] come from the random numbers of the operating
    /// system, and its hash (SipHash) does not disclose them.
    pub(super) fn random() -> Self {
        let word = |_| {
            let mut hasher = RandomState::new().build_hasher();
            hasher.write_u32(std::process::id());
            format!("{:016x}", hasher.finish())
        };
        Self((0..2).map(word).collect())
    }

    /// The token as text.
    pub(super) fn text(&self) -> &str {
        &self.0
    }

    /// The part of a request's target behind the token, with its slash; None without the token.
    pub(super) fn strip<'a>(&self, target: &'a str) -> Option<&'a str> {
        let rest = target.strip_prefix('/')?;
        let (token, path) = rest.split_at_checked(self.0.len())?;
        // All bytes are compared, so that the time does not tell how many are right.
        let pairs = token.bytes().zip(self.0.bytes());
        let difference = pairs.fold(0, |sum, (a, b)| sum | (a ^ b));
        (difference == 0 && path.starts_with('/')).then_some(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_token_opens_a_path() {
        let (token, other) = (Token::random(), Token::random());
        assert_eq!(token.text().len(), 32);
        assert_ne!(token.text(), other.text());
        let path = |token: &Token| format!("/{}/api/marks?x=1", token.text());
        assert_eq!(token.strip(&path(&token)), Some("/api/marks?x=1"));
        assert_eq!(token.strip(&path(&other)), None);
        for bad in [
            "",
            "/",
            "/api/marks",
            &path(&token)[1..],
            &path(&token)[..33],
        ] {
            assert_eq!(token.strip(bad), None, "{bad}");
        }
    }
}
