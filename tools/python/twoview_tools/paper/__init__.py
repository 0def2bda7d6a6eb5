"""The paper's figures and tables, remade from real data: docs/paper.md."""
