use super::*;
use crate::raster::spec::Reduce;
use crate::raster::test_picture::{grey_alpha, pixel, tiles};
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

fn finish(writer: CogWriter) -> Result<(), RasterError> {
    let mut outputs = OutputSet::default();
    writer.finish(&mut outputs)?;
    Ok(outputs.commit()?)
}

/// Writes a picture in batches of `batch` tiles, in the order of `order`, and returns the file.
fn written(
    spec: RasterSpec,
    compression: Compression,
    batch: usize,
    order: impl Fn(&RasterTile) -> u64,
) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("a.tif");
    let mut writer = CogWriter::begin(&target, spec, compression).unwrap();
    let mut all = tiles(&spec);
    all.sort_by_key(order);
    for batch in all.chunks(batch) {
        writer.add(batch.to_vec()).unwrap();
    }
    finish(writer).unwrap();
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    std::fs::read(&target).unwrap()
}

fn in_order(tile: &RasterTile) -> u64 {
    u64::from(tile.row) << 32 | u64::from(tile.column)
}

/// The bytes of the tiles of a level, decoded by an independent decoder and cropped to the picture;
/// None for empty tiles.
fn decoded(file: &[u8], directory: usize) -> Vec<Option<Vec<u8>>> {
    let mut decoder = Decoder::new(io::Cursor::new(file))
        .unwrap()
        .with_limits(Limits::unlimited());
    decoder.seek_to_image(directory).unwrap();
    let counts = decoder.get_tag_u64_vec(Tag::TileByteCounts).unwrap();
    (0..decoder.tile_count().unwrap())
        .map(|index| {
            (counts[index as usize] > 0).then(|| match decoder.read_chunk(index).unwrap() {
                DecodingResult::U8(values) => values,
                DecodingResult::U16(values) => values
                    .iter()
                    .flat_map(|value| value.to_ne_bytes())
                    .collect(),
                DecodingResult::U32(values) => values
                    .iter()
                    .flat_map(|value| value.to_ne_bytes())
                    .collect(),
                DecodingResult::F32(values) => values
                    .iter()
                    .flat_map(|value| value.to_ne_bytes())
                    .collect(),
                other => panic!("{other:?}"),
            })
        })
        .collect()
}

/// Specifications of all lossless kinds of pictures.
fn specs() -> Vec<RasterSpec> {
    let grey = grey_alpha(1300, 1700);
    let plain = RasterSpec {
        alpha: false,
        ..grey
    };
    vec![
        grey,
        RasterSpec {
            channels: 3,
            ..grey
        },
        RasterSpec {
            samples: SampleType::U16,
            ..grey
        },
        RasterSpec {
            samples: SampleType::F32,
            ..plain
        },
        RasterSpec {
            samples: SampleType::U32,
            nodata: Some(Nodata::Max),
            reduce: Reduce::First,
            ..plain
        },
        grey_alpha(300, 200),
    ]
}

#[test]
fn deflate_gives_back_the_pixels() {
    for spec in specs() {
        let file = written(spec, Compression::Deflate, 5, in_order);
        let [columns, _] = spec.grid(0);
        let tiles = decoded(&file, 0);
        assert_eq!(tiles.len(), spec.tiles_of(0));
        for (index, tile) in tiles.into_iter().enumerate() {
            let (column, row) = (index as u32 % columns, index as u32 / columns);
            let [width, height] = spec.extent(0, column, row);
            let (left, top) = (column as usize * TILE_EDGE_PX, row as usize * TILE_EDGE_PX);
            let expected: Vec<u8> = (0..height)
                .flat_map(|y| (0..width).map(move |x| (x, y)))
                .flat_map(|(x, y)| pixel(&spec, left + x, top + y))
                .collect();
            match tile {
                Some(tile) => assert!(tile == expected, "{spec:?}: {column}, {row}"),
                None => assert!(expected == pixel(&spec, 0, 0).repeat(width * height)),
            }
        }
    }
}

#[test]
fn overviews_are_the_reduced_picture() {
    let spec = grey_alpha(1300, 1700);
    let file = written(spec, Compression::Deflate, 5, in_order);
    let overview = decoded(&file, 1)[3].clone().unwrap();
    let [width, _] = spec.extent(1, 1, 1);
    for (x, y) in [(0, 0), (17, 200), (width - 1, 300)] {
        let (left, top) = (2 * (TILE_EDGE_PX + x), 2 * (TILE_EDGE_PX + y));
        let places = [(0, 0), (1, 0), (0, 1), (1, 1)];
        let sum: u32 = places
            .map(|(dx, dy)| u32::from(pixel(&spec, left + dx, top + dy)[0]))
            .iter()
            .sum();
        assert_eq!(u32::from(overview[2 * (y * width + x)]), (sum + 2) / 4);
    }
    assert_eq!(decoded(&file, 2).len(), 1);
    let mut decoder = Decoder::new(io::Cursor::new(&file[..])).unwrap();
    assert!(decoder.seek_to_image(3).is_err());
}

#[test]
fn order_batches_and_threads_leave_no_trace() {
    let shuffled = |tile: &RasterTile| (in_order(tile).wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 7;
    let jpeg = Compression::Jpeg { quality: 80 };
    for (spec, compression) in [
        (grey_alpha(1300, 1700), Compression::Deflate),
        (
            RasterSpec {
                channels: 3,
                ..grey_alpha(1300, 1700)
            },
            jpeg,
        ),
    ] {
        let first = written(spec, compression, usize::MAX, in_order);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let again = pool.install(|| written(spec, compression, 3, shuffled));
            assert!(again == first, "{threads} threads");
        }
    }
}

/// A picture that is divided among three writers, by rows and by columns.
#[test]
fn parts_together_are_the_bytes_of_the_whole() {
    for spec in specs() {
        let whole = written(spec, Compression::Deflate, 1, in_order);
        for part_of in [
            |tile: &RasterTile| (tile.row as usize).min(2),
            |tile: &RasterTile| tile.column as usize % 3,
        ] {
            let dir = tempfile::tempdir().unwrap();
            let target = dir.path().join("a.tif");
            let mut writer = CogWriter::begin(&target, spec, Compression::Deflate).unwrap();
            for part in [2, 0, 1] {
                let spool = dir.path().join(format!("part-{part}"));
                let begin = |state| {
                    CogWriter::begin_resumable(&target, spec, Compression::Deflate, &spool, state)
                };
                let mut all = tiles(&spec);
                all.retain(|tile| part_of(tile) == part);
                let mut one = begin(None).unwrap();
                one.add(all).unwrap();
                let state = postcard::to_allocvec(&one.state().unwrap()).unwrap();
                let state = || postcard::from_bytes::<CogState>(&state).unwrap();
                writer.absorb(state(), &spool).unwrap();
                if part == 0 {
                    let twice = writer.absorb(state(), &spool).unwrap_err();
                    assert!(matches!(twice, RasterError::Tile { .. }), "{twice}");
                }
            }
            finish(writer).unwrap();
            assert!(std::fs::read(&target).unwrap() == whole);
        }
    }
}

#[test]
fn every_tile_stands_between_its_size_and_its_end() {
    let spec = RasterSpec {
        channels: 3,
        ..grey_alpha(1300, 1700)
    };
    let file = written(spec, Compression::Jpeg { quality: 80 }, 5, in_order);
    let mut decoder = Decoder::new(io::Cursor::new(&file[..])).unwrap();
    let mut blocks = Vec::new();
    for directory in 0..6 {
        decoder.seek_to_image(directory).unwrap();
        let offsets = decoder.get_tag_u64_vec(Tag::TileOffsets).unwrap();
        let counts = decoder.get_tag_u64_vec(Tag::TileByteCounts).unwrap();
        for (offset, count) in offsets.into_iter().zip(counts) {
            if count == 0 {
                assert_eq!((directory < 2, offset), (true, 0));
                continue;
            }
            let (start, end) = (offset as usize, (offset + count) as usize);
            assert_eq!(file[start - 4..start], (count as u32).to_le_bytes());
            assert_eq!(file[end..end + 4], file[end - 4..end]);
            blocks.push((start - 4, end + 4));
        }
    }
    blocks.sort();
    assert!(blocks.windows(2).all(|pair| pair[0].1 == pair[1].0));
    assert_eq!(blocks.last().unwrap().1, file.len());
}

#[test]
fn what_is_not_whole_leaves_the_old_file_and_no_litter() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("a.tif");
    std::fs::write(&target, "old").unwrap();
    let spec = grey_alpha(700, 900);
    let mut writer = CogWriter::begin(&target, spec, Compression::Deflate).unwrap();
    let mut all = tiles(&spec);
    all.pop();
    writer.add(all).unwrap();
    let error = finish(writer).unwrap_err().to_string();
    assert!(error.contains("2 of 5 tiles"), "{error}");
    drop(CogWriter::begin(&target, spec, Compression::Deflate).unwrap());
    assert_eq!(std::fs::read_to_string(&target).unwrap(), "old");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn what_the_file_cannot_hold_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("a.tif");
    let spec = grey_alpha(700, 900);
    let wide = RasterSpec {
        samples: SampleType::U16,
        ..spec
    };
    for (spec, quality) in [(spec, 0), (spec, 101), (wide, 80)] {
        let jpeg = Compression::Jpeg { quality };
        assert!(CogWriter::begin(&target, spec, jpeg).is_err());
    }
    assert!(CogWriter::begin(dir.path(), spec, Compression::Deflate).is_err());
    let nowhere = dir.path().join("missing/a.tif");
    assert!(CogWriter::begin(&nowhere, spec, Compression::Deflate).is_err());
}
