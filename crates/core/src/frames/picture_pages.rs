//! Pages of TIFF files.

use std::io::BufReader;
use std::path::Path;
use tunnelstitch_geometry::files::open_regular;

/// Largest number of pages that are counted.
const MAX_PAGES: usize = 100_000;

/// Number of the pages of a TIFF file that are as large as the first one; 1 for other pictures, and
/// for files that cannot be read. Smaller ones are previews.
pub fn count_pages(path: &Path) -> usize {
    pages(path).unwrap_or(1)
}

fn pages(path: &Path) -> Option<usize> {
    let file = BufReader::new(open_regular(path).ok()?);
    let mut decoder = tiff::decoder::Decoder::new(file).ok()?;
    let size = decoder.dimensions().ok()?;
    let (mut count, mut looked_at) = (1, 1);
    while decoder.more_images() && looked_at < MAX_PAGES {
        decoder.next_image().ok()?;
        looked_at += 1;
        count += usize::from(decoder.dimensions().ok()? == size);
    }
    Some(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiff::encoder::{TiffEncoder, colortype};

    #[test]
    fn pages_as_large_as_the_first_are_counted() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("stack.tif");
        let mut encoder = TiffEncoder::new(std::fs::File::create(&path).unwrap()).unwrap();
        for [width, height] in [[4, 3], [4, 3], [2, 1], [4, 3]] {
            let page = vec![7; (width * height) as usize];
            encoder
                .write_image::<colortype::Gray8>(width, height, &page)
                .unwrap();
        }
        drop(encoder);
        assert_eq!(count_pages(&path), 3);
        let other = dir.path().join("a.png");
        image::GrayImage::new(4, 3).save(&other).unwrap();
        assert_eq!(count_pages(&other), 1);
        assert_eq!(count_pages(&dir.path().join("missing.tif")), 1);
    }
}
