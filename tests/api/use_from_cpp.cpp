// SPDX-License-Identifier: MIT
//
// A C++ program as a user of the library writes it: the header, the library,
// vectors. Prints the CRC of a file's first moment in its first camera.
//
//     use_from_cpp FILE.saga
#include <saga.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <vector>

namespace {

void check(saga_status s)
{
    if (s < SAGA_OK)
        throw std::runtime_error(saga_status_text(s));
}

// A decoder and the memory in which it lives.
class player {
public:
    explicit player(std::vector<std::uint8_t> bytes) : bytes_(std::move(bytes))
    {
        check(saga_probe(&info_, bytes_.data(), bytes_.size()));
        block_.resize(info_.work_nbytes + SAGA_WORK_ALIGN);
        const auto at = reinterpret_cast<std::uintptr_t>(block_.data());
        check(saga_open(&dec_, block_.data() +
                            (SAGA_WORK_ALIGN - at % SAGA_WORK_ALIGN),
                        info_.work_nbytes, bytes_.data(), bytes_.size(), NULL));
    }

    saga_camera camera(std::uint32_t index) const
    {
        saga_camera c{};
        std::uint32_t number = 0;
        check(saga_rig(&c, &number, bytes_.data(), bytes_.size(), index));
        return c;
    }

    std::vector<std::uint8_t> picture(std::uint32_t frame, const saga_camera &c)
    {
        saga_segment seg{};
        check(saga_find(&seg, bytes_.data(), bytes_.size(), frame, 1));
        if (seg.offset > bytes_.size() ||
            seg.nbytes > bytes_.size() - seg.offset)
            check(SAGA_ERR_TRUNCATED);
        check(saga_decode(dec_, &seg, bytes_.data() + seg.offset, seg.nbytes,
                          NULL));
        check(saga_view(dec_, &c, seg.t));
        return draw(c);
    }

private:
    std::vector<std::uint8_t> draw(const saga_camera &c) const
    {
        std::vector<std::uint8_t> rgb(std::size_t{3} * c.width * c.height);
        std::vector<std::uint32_t> scratch(SAGA_JOB_NBYTES(32, 4096) / 4 + 1);
        saga_picture to{rgb.data(), std::size_t{3} * c.width, rgb.size(), 8};
        saga_job job{};
        job.x1 = c.width;
        job.y1 = c.height;
        job.tile = 32;
        job.list_capacity = 4096;
        job.scratch = scratch.data();
        job.scratch_nbytes = scratch.size() * 4;
        saga_status s;
        do
            check(s = saga_draw(dec_, &job, &to, 1u << 20));
        while (s == SAGA_AGAIN);
        return rgb;
    }

    std::vector<std::uint8_t> bytes_, block_;
    saga_info info_{};
    saga_decoder *dec_ = nullptr;
};

} // namespace

int main(int argc, char **argv)
{
    if (argc != 2)
        return 2;
    try {
        std::ifstream file(argv[1], std::ios::binary);
        player p({std::istreambuf_iterator<char>(file), {}});
        const auto rgb = p.picture(0, p.camera(0));
        std::printf("%08lx\n", static_cast<unsigned long>(
                                   saga_crc32c(0, rgb.data(), rgb.size())));
    } catch (const std::exception &e) {
        std::fprintf(stderr, "%s: %s\n", argv[1], e.what());
        return 1;
    }
}
