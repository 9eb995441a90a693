//! Writes pictures of every kind that [`tunnelstitch::raster`] knows, tile by tile in no order, into the folder named,
//! and the pixels of each as they are beside it (`.raw`). `benches/check_raster.py` compares the two through the
//! programs of others.

use std::error::Error;
use std::path::{Path, PathBuf};
use tunnelstitch::raster::{
    CogWriter, Compression, DziFormat, DziWriter, EDGE, Georeference, Nodata, RasterSpec,
    RasterTile, Reduce, SampleType,
};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("name a folder")?);
    std::fs::create_dir_all(&folder)?;
    let grey = RasterSpec {
        width: 1900,
        height: 5000,
        samples: SampleType::U8,
        channels: 1,
        alpha: true,
        nodata: None,
        reduce: Reduce::Mean,
        georeference: Some(Georeference {
            origin_m: [-1.5, 120.25],
            step_m: [0.0005, 0.0005],
        }),
    };
    let colour = RasterSpec {
        channels: 3,
        ..grey
    };
    let jpeg = Compression::Jpeg { quality: 85 };
    let upwards = Some(Georeference {
        origin_m: [-1.5, 120.25],
        step_m: [0.0005, -0.0005],
    });
    let plain = RasterSpec {
        alpha: false,
        georeference: upwards,
        ..grey
    };
    let pictures = [
        ("grey", grey, Compression::Deflate),
        ("grey_jpeg", grey, jpeg),
        ("grey_opaque_jpeg", plain, jpeg),
        ("colour", colour, Compression::Deflate),
        ("colour_jpeg", colour, jpeg),
        (
            "colour_small_jpeg",
            RasterSpec {
                width: 300,
                height: 200,
                ..colour
            },
            jpeg,
        ),
        (
            "grey16",
            RasterSpec {
                samples: SampleType::U16,
                ..grey
            },
            Compression::Deflate,
        ),
        (
            "float",
            RasterSpec {
                samples: SampleType::F32,
                ..plain
            },
            Compression::Deflate,
        ),
        (
            "labels",
            RasterSpec {
                samples: SampleType::U32,
                nodata: Some(Nodata::Max),
                reduce: Reduce::First,
                ..plain
            },
            Compression::Deflate,
        ),
        (
            "counts_small",
            RasterSpec {
                width: 300,
                height: 200,
                samples: SampleType::U16,
                nodata: Some(Nodata::Zero),
                georeference: None,
                ..plain
            },
            Compression::Deflate,
        ),
    ];
    for (name, spec, compression) in pictures {
        let path = folder.join(name).with_extension("tif");
        let mut writer = CogWriter::begin(&path, spec, compression)?;
        for batch in batches(&spec) {
            writer.add(batch)?;
        }
        writer.finish()?;
        write_raw(&path, &spec)?;
    }
    for (name, format) in [
        ("png", DziFormat::Png),
        ("jpeg", DziFormat::Jpeg { quality: 85 }),
    ] {
        let path = folder.join(name).with_extension("dzi");
        let mut writer = DziWriter::begin(&path, colour, format)?;
        for batch in batches(&colour) {
            writer.add(batch)?;
        }
        writer.finish()?;
        write_raw(&path, &colour)?;
    }
    Ok(())
}

/// The bytes of a pixel: blots of colour, a large hole above and small ones everywhere.
fn pixel(spec: &RasterSpec, x: usize, y: usize) -> Vec<u8> {
    let hole = ((400..1100).contains(&x) && y < 600 + x / 3) || (x / 9 + y / 7).is_multiple_of(31);
    let blot = (x / 60 + y / 90 * 7) % 29;
    let value = |k: usize| (blot * 30 + (x + y) % 60 + 40 * k + 20) as f64 / 1024.0;
    (0..spec.samples_per_pixel())
        .flat_map(|k| {
            let alpha = k == usize::from(spec.channels);
            let number = |max: u32| match (hole, alpha) {
                (true, _) if spec.nodata == Some(Nodata::Max) => max,
                (true, _) => 0,
                (false, true) => max,
                (false, false) => (value(k) * f64::from(max)) as u32,
            };
            match spec.samples {
                SampleType::U8 => vec![number(255) as u8],
                SampleType::U16 => (number(65535) as u16).to_ne_bytes().to_vec(),
                SampleType::U32 => number(u32::MAX).to_ne_bytes().to_vec(),
                SampleType::F32 if hole => f32::NAN.to_ne_bytes().to_vec(),
                SampleType::F32 => (value(k) as f32).to_ne_bytes().to_vec(),
            }
        })
        .collect()
}

/// All tiles, from the last to the first and in batches that are no rows.
fn batches(spec: &RasterSpec) -> impl Iterator<Item = Vec<RasterTile>> {
    let edge = EDGE as u32;
    let (columns, rows) = (spec.width.div_ceil(edge), spec.height.div_ceil(edge));
    let places: Vec<(u32, u32)> = (0..columns * rows)
        .rev()
        .map(|index| (index % columns, index / columns))
        .collect();
    let batches: Vec<Vec<(u32, u32)>> = places.chunks(5).map(<[_]>::to_vec).collect();
    let spec = *spec;
    batches.into_iter().map(move |batch| {
        batch
            .into_iter()
            .map(|(column, row)| tile(&spec, column, row))
            .collect()
    })
}

fn tile(spec: &RasterSpec, column: u32, row: u32) -> RasterTile {
    let mut pixels = vec![0; spec.tile_bytes()];
    let bytes = pixels.len() / (EDGE * EDGE);
    for (place, out) in pixels.chunks_exact_mut(bytes).enumerate() {
        let x = column as usize * EDGE + place % EDGE;
        let y = row as usize * EDGE + place / EDGE;
        if x < spec.width as usize && y < spec.height as usize {
            out.copy_from_slice(&pixel(spec, x, y));
        }
    }
    RasterTile {
        column,
        row,
        pixels,
    }
}

fn write_raw(path: &Path, spec: &RasterSpec) -> std::io::Result<()> {
    let rows = 0..spec.height as usize;
    let pixels: Vec<u8> = rows
        .flat_map(|y| (0..spec.width as usize).map(move |x| (x, y)))
        .flat_map(|(x, y)| pixel(spec, x, y))
        .collect();
    std::fs::write(path.with_extension("raw"), pixels)
}
