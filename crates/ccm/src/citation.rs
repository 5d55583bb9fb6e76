//! What to cite and where the data are: as given on the page of the data set
//! (<https://corsmal.eecs.qmul.ac.uk/containers_manip.html>).

use corsmal_report::{Fact, Snippet};

/// Title of the paper.
pub const PAPER: &str = "The CORSMAL benchmark for the prediction of the properties of containers";
/// Address of the paper.
pub const PAPER_DOI: &str = "https://doi.org/10.1109/ACCESS.2022.3166906";
/// Name of the data set.
pub const DATA: &str = "CORSMAL Containers Manipulation (1.0)";
/// Address of the data set for citation.
pub const DATA_DOI: &str = "https://doi.org/10.17636/101CORSMAL1";
/// Page with the downloads.
pub const DATA_PAGE: &str = "https://corsmal.eecs.qmul.ac.uk/containers_manip.html";
/// Licence of the data set.
pub const DATA_LICENCE: &str = "CC BY-NC 4.0";
/// Address of that licence.
pub const DATA_LICENCE_PAGE: &str = "https://creativecommons.org/licenses/by-nc/4.0/";

const BIBTEX_PAPER: &str = "\
@article{Xompero2022CORSMALBenchmark,
  title   = {The {CORSMAL} benchmark for the prediction of the properties of containers},
  author  = {Xompero, A. and Donaher, S. and Iashin, V. and Palermo, F. and Solak, G. and
             Coppola, C. and Ishikawa, R. and Nagao, Y. and Hachiuma, R. and Liu, Q. and
             Feng, F. and Lan, C. and Chan, R. H. M. and Christmann, G. and Song, J. and
             Neeharika, G. and Reddy, C. K. T. and Jain, D. and Rehman, B. U. and
             Cavallaro, A.},
  journal = {IEEE Access},
  volume  = {10},
  year    = {2022},
  doi     = {10.1109/ACCESS.2022.3166906}
}";

const BIBTEX_DATA: &str = "\
@misc{Xompero_CCM,
  title     = {{CORSMAL} Containers Manipulation (1.0) [Data set]},
  author    = {Xompero, A. and Sanchez-Matilla, R. and Mazzon, R. and Cavallaro, A.},
  publisher = {Queen Mary University of London},
  doi       = {10.17636/101CORSMAL1}
}";

/// The paper, the data and its licence, with their addresses.
pub fn facts() -> Vec<Fact> {
    vec![
        Fact::linked("Paper", &format!("{PAPER}. IEEE Access, vol. 10, 2022"), PAPER_DOI),
        Fact::linked("Data set", &format!("{DATA}, doi:10.17636/101CORSMAL1"), DATA_DOI),
        Fact::linked("Download", "corsmal.eecs.qmul.ac.uk/containers_manip.html", DATA_PAGE),
        Fact::linked("Licence of the data", DATA_LICENCE, DATA_LICENCE_PAGE),
    ]
}

/// BibTeX entries of the paper and of the data set.
pub fn bibtex() -> Vec<Snippet> {
    [("BibTeX, paper", BIBTEX_PAPER), ("BibTeX, data set", BIBTEX_DATA)]
        .map(|(title, text)| Snippet { title: title.into(), text: text.into() })
        .to_vec()
}

/// The methods of the paper by their short names: team and approach.
pub fn methods() -> Vec<Fact> {
    [
        (
            "M1",
            "Challengers. Audio: a fully connected network of five layers on spectral features; \
             level and type.",
        ),
        (
            "M2",
            "NTNU-ERC. Audio: a convolutional network on 40 MFCCs; type. Depth of one camera: a \
             convolutional network on the region of the container; capacity.",
        ),
        (
            "M3",
            "Concatenation (VA2Mass). A detector finds the category of the container (cup, glass, \
             box) in four views; perceptrons on spectrograms, one for each category, estimate \
             level and type, Gaussian processes the capacity.",
        ),
        (
            "M4",
            "HVRL. Audio: a convolutional network on windows of an 8-channel log-mel spectrogram \
             with a vote for the type, an LSTM on its features for the level. Colour and depth of \
             one camera: points on the container; capacity.",
        ),
        (
            "M5",
            "Because It's Tactile. A forest on 136 audio features and recurrent networks on VGGish \
             embeddings, for the level also on video features, averaged; level and type. A shape \
             fitted to the masks of two views; capacity.",
        ),
        (
            "M6",
            "ACC. Audio: convolutional networks on spectrograms; one distinguishes pouring, \
             shaking and neither, two others predict the filling for each action; level and type.",
        ),
    ]
    .map(|(name, text)| Fact::new(name, text))
    .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_and_addresses_name_the_same_documents() {
        let entries = bibtex();
        let named = |entry: &Snippet, address: &str| {
            let doi = address.trim_start_matches("https://doi.org/");
            entry.text.contains(doi) && entry.text.ends_with("\n}")
        };
        assert!(named(&entries[0], PAPER_DOI) && named(&entries[1], DATA_DOI));
        assert_eq!(methods().len(), 6);
    }
}
