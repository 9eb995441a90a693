//! Files of other kinds than text that people name in place of a text, recognised by their
//! beginning.

/// Beginnings of files, and sentences that say what they are, with the remedy.
const KINDS: [(&[u8], &str); 10] = [
    (
        b"\x1f\x8b",
        "is packed by gzip, not text; unpack it (gunzip)",
    ),
    (b"\xfd7zXZ\0", "is packed by xz, not text; unpack it (unxz)"),
    (b"BZh", "is packed by bzip2, not text; unpack it (bunzip2)"),
    (
        b"\x28\xb5\x2f\xfd",
        "is packed by Zstandard, not text; unpack it (unzstd)",
    ),
    (b"7z\xbc\xaf\x27\x1c", "is a 7-Zip archive; unpack it"),
    (
        b"%PDF-",
        "is a PDF document; save the table behind it as text",
    ),
    (
        b"MATLAB 5.0 MAT-file",
        "is a file of MATLAB; save the array as text (writematrix)",
    ),
    (
        b"\x93NUMPY",
        "is a NumPy array; save it as text: a = np.load(\"poses.npy\"); \
         np.savetxt(\"poses.txt\", a.reshape(len(a), -1))",
    ),
    (
        b"{\\rtf",
        "is formatted text (RTF), as TextEdit and WordPad save it; save it as plain text",
    ),
    (LFS_POINTER, LFS_SENTENCE),
];

/// Beginning of the pointer that Git LFS leaves in place of a large file.
const LFS_POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";
const LFS_SENTENCE: &str =
    "is a pointer of Git LFS in place of the file; `git lfs pull` fetches the file";

/// Says what a file is, by its content or its first bytes, if it is of another kind.
pub(super) fn kind(content: &[u8]) -> Option<&'static str> {
    if content.starts_with(b"PK\x03\x04") {
        return Some(zip_kind(content));
    }
    let is_of = |(beginning, _): &&(&[u8], &str)| content.starts_with(beginning);
    let known = KINDS.iter().find(is_of).map(|(_, sentence)| *sentence);
    known.or_else(|| {
        is_web_page(content).then_some(
            "is a web page, as servers send in place of a file; download the file itself",
        )
    })
}

/// Says that a file is a pointer of Git LFS, by its first bytes, if it is.
pub fn git_lfs_pointer(start: &[u8]) -> Option<&'static str> {
    start.starts_with(LFS_POINTER).then_some(LFS_SENTENCE)
}

/// Says what a ZIP archive is: the name of its first file stands after 30 bytes.
fn zip_kind(content: &[u8]) -> &'static str {
    let name = content.get(26).zip(content.get(30..));
    let name = name.and_then(|(length, rest)| rest.get(..usize::from(*length)));
    match name.is_some_and(|name| name.ends_with(b".npy")) {
        true => "is an archive of NumPy arrays; save the array of poses by numpy.savetxt",
        false => {
            "is a workbook of a spreadsheet or another ZIP archive, not text; save the sheet as \
             CSV, or unpack it"
        }
    }
}

/// True for the beginning of an HTML document.
fn is_web_page(content: &[u8]) -> bool {
    let start = content.trim_ascii_start();
    let begins = |with: &[u8]| {
        let own = start.get(..with.len());
        own.is_some_and(|own| own.eq_ignore_ascii_case(with))
    };
    begins(b"<!doctype html") || begins(b"<html")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_text_is_named() {
        for (content, expected) in [
            (&b"\x1f\x8b\x08\0"[..], "gunzip"),
            (b"\n <!DOCTYPE HTML><html>", "web page"),
            (b"<html lang=\"en\">", "web page"),
            (
                b"version https://git-lfs.github.com/spec/v1\noid",
                "git lfs pull",
            ),
            (b"PK\x03\x04\x14\0", "save the sheet as CSV"),
            (b"\x93NUMPY\x01\0", "np.savetxt"),
            (b"{\\rtf1\\ansi", "plain text"),
        ] {
            let kind = kind(content).unwrap();
            assert!(kind.contains(expected), "{kind}");
        }
        let mut arrays = b"PK\x03\x04".to_vec();
        arrays.resize(30, 0);
        arrays[26] = 9;
        arrays.extend_from_slice(b"poses.npy");
        assert!(kind(&arrays).unwrap().contains("numpy.savetxt"));
        for text in [&b""[..], b"0 0 0 0 0 0 0 1\n", b"<document/>", b"BZ 1"] {
            assert_eq!(kind(text), None);
        }
    }
}
