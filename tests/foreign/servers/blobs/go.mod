module blobs

go 1.19
