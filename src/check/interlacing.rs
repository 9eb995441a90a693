//! Warning of interlaced frames, with the command that deinterlaces them.

use crate::survey::Survey;

/// Warning of interlaced frames, with the command of ffmpeg that deinterlaces them.
///
/// Pictures of a video have neighbours in time, by which `bwdif` fills in the rows; of pictures in
/// files, the even rows are kept and stretched.
pub fn interlacing_warning(survey: &Survey) -> String {
    let frames = &survey.file.frames;
    let remedy = match (&frames.video, &frames.bag, &frames.images) {
        (Some(video), ..) => format!(
            "ffmpeg -i {} -vf bwdif=mode=send_frame -c:v libx264 -crf 12 deinterlaced.mp4",
            video.display()
        ),
        (None, Some(_), _) => {
            "let the driver of the camera do so, or record whole pictures".to_owned()
        }
        (None, None, images) => format!(
            "mkdir deinterlaced; ffmpeg -pattern_type glob -i '{}' -vf field=top,scale=iw:2*ih \
             -start_number 0 deinterlaced/%06d.png (and add 0.5 to cy of the calibration)",
            images.as_deref().unwrap_or("frames/*.png")
        ),
    };
    format!(
        "the frames are interlaced: their even and odd rows were taken at different times, and no \
         pose fits both; deinterlace them: {remedy}"
    )
}
