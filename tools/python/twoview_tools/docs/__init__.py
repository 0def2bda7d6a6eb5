"""What builds the site of docs/ and checks what is written there: scripts/docs and test/docs."""
