"""One hit: found in the stream, cut out, measured, judged; its momenta; a person's word on it."""
