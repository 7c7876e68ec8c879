"""One run of an arm: what drives it, how it is integrated, what comes out and how that is written."""
